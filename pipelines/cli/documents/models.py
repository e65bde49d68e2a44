"""The JSON documents of the version of a model and of the demonstration."""

from __future__ import annotations

from typing import Annotated, Any

from typing_extensions import TypedDict


class ExtendDocument(TypedDict):
    """``extend --json``: the version of a model that was written."""

    file: str
    model: Annotated[str, "its name"]
    version: int
    effects: list[str]
    added: Annotated[str | None, "null: an effect was removed"]
    removed: Annotated[str | None, "null: an effect was added"]
    begun: Annotated[bool, "whether the file is new"]
    by: str
    at: Annotated[str, "ISO date and time, UTC"]
    why: str


class DemoErrors(TypedDict):
    """Errors of a model over all units, µg."""

    rms_ug: Annotated[float, "residual of the fit"]
    heldout_rms_ug: Annotated[float | None, "cross-validated"]
    fresh_rms_ug: Annotated[float | None, "on the second run"]
    floor_ug: Annotated[float, "noise of the measurement"]


class HiddenEffect(TypedDict):
    """The effect that the demonstration hid."""

    kind: str
    effect: str
    physics: str


class DemoDocument(TypedDict):
    """``demo --auto --json``: the hidden effect, the diagnosis, and the errors before and after."""

    seed: int
    hidden: HiddenEffect
    classes: Annotated[list[list[str]], "effects that the data do not separate, best first"]
    recommended: list[str]
    unseen: Annotated[list[Any], "effects that the plan cannot show, as in `diagnose --json`"]
    added: list[str]
    found: bool
    told_apart: Annotated[bool, "whether the hidden effect is alone in its class"]
    not_told_apart: list[list[str]]
    next_measurements: Annotated[list[Any], "as in `diagnose --json`"]
    before: DemoErrors
    after: DemoErrors
    folder: str


class DemoFilesDocument(TypedDict):
    """``demo --by-hand --json``: the files of the two runs."""

    folder: str
    files: list[str]
    effects: Annotated[list[str], "the model to begin with"]
