"""Bring-up of one real device with a person beside it: reach it, read it, order the smallest steps, and say what differs."""
