"""Entries of ``[uncertainty]`` for equipment that compares a device with a reference sensor: exciters and shock machines."""

from pydantic import model_validator

from schemas.bounds import NotNegative, Positive
from schemas.stated import AngleEntry, Entry, Stated
from schemas.strict import OnlyStated


class ShareEntry(Entry):
    """A share of the measured acceleration."""

    u_percent: Stated = None
    U_percent: Stated = None
    half_width_percent: Stated = None


class Comparison(OnlyStated):
    """The uncertainty of a comparison.

    reference, drift : of the reference sensor · amplitude : ratio of the two channels · transverse : motion across the axis
    distortion : what distortion of the motion leaves in a fitted tone · mounting : relative motion of the two sensors
    phase : between the two channels
    """

    reference: ShareEntry | None = None
    drift: ShareEntry | None = None
    amplitude: ShareEntry | None = None
    transverse: ShareEntry | None = None
    distortion: ShareEntry | None = None
    mounting: ShareEntry | None = None
    phase: AngleEntry | None = None

    @property
    def entries(self) -> dict[str, Entry]:
        """The entries that are stated, by name."""
        return {name: entry for name in TERMS if isinstance(entry := getattr(self, name), Entry)}


TERMS = tuple(Comparison.model_fields)
"""The terms of a comparison, in the order of a budget."""


class ExciterBand(Comparison):
    """The uncertainty of an exciter from one frequency to another, both in Hz."""

    from_hz: NotNegative
    to_hz: Positive

    @model_validator(mode="after")
    def _ordered(self) -> "ExciterBand":
        if self.from_hz >= self.to_hz:
            raise ValueError(f"from_hz: {self.from_hz:g} Hz is not below to_hz, {self.to_hz:g} Hz; correct one")
        return self
