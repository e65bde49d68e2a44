"""The state of an installation and of what it is connected to; nothing is moved, and nothing is left behind."""
