"""Calibration of accelerometers from Python: read, fit, diagnose, improve, and look into an archive.

Everything is what the commands of the same names do, by the same code, with the same verdicts and the same errors::

    import tumbleline as tl
    run = tl.read("six_faces.csv")     # a file of any system, a DataFrame, or a run of an archive
    fit = tl.fit(run)                  # coefficients with units and U; prints as a table
    tl.diagnose(run, fit).missing      # which physical effects are missing
    better = tl.improve(run)           # diagnose, add, judge on what was left out
    better.correct(samples)            # specific force in g
    tl.archive("archive").coefficients(unit="TL0001", at="2026-05-01")

A name is imported when it is used first: ``import tumbleline`` loads neither pandas nor a station.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from schemas.errors import DataRejected, TumblelineError, WrongUse
    from tumbleline.archives import ArchiveView, archive
    from tumbleline.calibrations import Calibration, fit
    from tumbleline.diagnoses import ModelDiagnosis, diagnose, effects
    from tumbleline.improvements import ImprovedModel, improve
    from tumbleline.pictures import Picture
    from tumbleline.recordings import Example, Recording, example, read

__all__ = [
    "ArchiveView",
    "Calibration",
    "DataRejected",
    "Example",
    "ImprovedModel",
    "ModelDiagnosis",
    "Picture",
    "Recording",
    "TumblelineError",
    "WrongUse",
    "archive",
    "diagnose",
    "effects",
    "example",
    "fit",
    "improve",
    "read",
]

_HOMES = {
    "tumbleline.archives": ("ArchiveView", "archive"),
    "tumbleline.calibrations": ("Calibration", "fit"),
    "tumbleline.diagnoses": ("ModelDiagnosis", "diagnose", "effects"),
    "tumbleline.improvements": ("ImprovedModel", "improve"),
    "tumbleline.pictures": ("Picture",),
    "tumbleline.recordings": ("Example", "Recording", "example", "read"),
    "schemas.errors": ("DataRejected", "TumblelineError", "WrongUse"),
}
_MODULES = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """The name from its module, at its first use."""
    if name not in _MODULES:
        raise AttributeError(f"module 'tumbleline' has no attribute '{name}'; it has {', '.join(__all__)}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
