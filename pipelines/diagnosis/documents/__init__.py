"""The JSON documents of diagnose, compare and history: keys that other programs read."""
