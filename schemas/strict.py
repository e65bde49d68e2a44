"""The base of every part of a file that is written by hand."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Strict(BaseModel):
    """A part of a file in which an unknown key is an error, not something to skip."""

    model_config = ConfigDict(extra="forbid", frozen=True)
