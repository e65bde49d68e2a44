"""Tables: the reader of dwells, frames, samples and JSON values."""
