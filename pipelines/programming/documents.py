"""The JSON document of the writing of coefficients into devices: keys that other programs read."""

from typing import Annotated, Literal

from typing_extensions import TypedDict


class VerifiedPoseDocument(TypedDict):
    """The verification of a device in one pose."""

    pose: str
    temperature_C: float
    force_g: Annotated[list[float], "true force, x, y, z"]
    output: Annotated[list[float], "mean output of the device"]
    corrected_g: Annotated[list[float], "the output, corrected with the coefficients in the device"]
    error_ug: list[float]
    magnitude_g: float
    from_archive_ug: Annotated[float, "largest difference from the correction with the archive's coefficients"]


class ProgrammedUnitDocument(TypedDict):
    """The outcome of programming one device."""

    unit: str
    outcome: Literal["proved", "failed"]
    step: Annotated[str, "the step that failed; empty if none did"]
    reason: Annotated[str, "empty if no step failed"]
    copy: Annotated[Literal["A", "B"], "of the block, that was written"]
    sequence: Annotated[int | None, "sequence number of the block; null: nothing was written"]
    form: Annotated[Literal["float32", "q24"] | None, "null: nothing was written"]
    crc32: Annotated[str, "hexadecimal"]
    bytes: int
    offsets: Annotated[list[int] | None, "steps of the offset registers; null: nothing was written"]
    poses: list[VerifiedPoseDocument]
    certificate: Annotated[str | None, "number of the renewed certificate; null: not certified"]


class TedsPageDocument(TypedDict):
    """A page of the memory of a device."""

    axis: str
    page: Annotated[int, "of 32 bytes, from 0"]
    content: Annotated[str, "hexadecimal"]


class TedsUnitDocument(TypedDict):
    """The outcome of writing the TEDS of one device."""

    unit: str
    outcome: Literal["proved", "failed"]
    step: Annotated[str, "the step that failed; empty if none did"]
    reason: Annotated[str, "empty if no step failed"]
    pages: list[TedsPageDocument]
    before: Annotated[str, "the whole memory before the first write, hexadecimal"]


class ProgramTedsDocument(TypedDict):
    """``station program --format teds --json``: the devices whose TEDS were written."""

    run: str
    teds: list[TedsUnitDocument]


class ProgramDocument(TypedDict):
    """``station program --json``: the devices whose memory was written."""

    run: str
    units: list[ProgrammedUnitDocument]
