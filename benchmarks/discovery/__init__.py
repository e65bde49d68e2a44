"""Discoveries in archives: false ones in worlds without anything hidden, and what is found where something is."""
