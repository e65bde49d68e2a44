"""Recordings of the links of a station: their reading, also of other programs' recordings, and their replay."""
