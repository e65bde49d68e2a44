"""Criticism of a model: is it good enough for the noise that is there, where does it fail, which effect is missing."""
