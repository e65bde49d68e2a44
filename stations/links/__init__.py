"""Links: transport of register access and text commands to the devices."""
