"""The JSON documents that commands compose themselves: keys that other programs read. A NotRequired key may be missing."""
