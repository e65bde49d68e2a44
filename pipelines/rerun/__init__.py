"""The archive again: runs through today's code or another model, what differs between two, and models for the line."""
