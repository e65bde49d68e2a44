"""The parts of the stage budget: measurands, contributions, decisions and risks of a lot."""
