"""A laboratory's file, as the makers of certificates give it."""

from pathlib import Path

LABORATORY = """
[laboratory]
name = "Example Sensor Works"
address = "Am Kornfeld 7, 38116 Braunschweig"
country = "DE"
email = "calibration@example.com"
[customer]
name = "Example Drones Ltd"
address = "12 Mill Lane, Cambridge"
email = "quality@example.org"
[signatory]
name = "J. Example"
role = "Head of calibration"
[item]
manufacturer = "Analog Devices"
"""


def laboratory_file(folder: Path) -> Path:
    """The file in a folder."""
    (folder / "laboratory.toml").write_text(LABORATORY, encoding="utf-8")
    return folder / "laboratory.toml"
