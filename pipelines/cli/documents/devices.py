"""The JSON documents of recordings that are corrected and devices that are programmed."""

from __future__ import annotations

from typing import Annotated, Literal

from typing_extensions import TypedDict

from pipelines.cli.documents.certificates import StatedCertificate


class BiasTrack(TypedDict):
    """The bias that was tracked."""

    last_ug: Annotated[dict[str, float], "at the end, by axis"]
    u_last_ug: Annotated[dict[str, float], "its standard uncertainty, by axis"]
    updates: int
    steps: int
    rejected: Annotated[int, "updates beyond five standard deviations"]
    nis: Annotated[float | None, "mean normalised innovation squared; null without updates"]
    nis_bounds: Annotated[list[float | None], "its 95 % bounds for consistent noise"]
    lag_1: Annotated[float | None, "correlation of successive innovations"]
    lag_1_bound: float | None
    stated_uncertainty: Annotated[str, "`consistent`, `too small` or `too large`, by the innovations"]
    processes_s: Annotated[list[float], "correlation times of the processes that represent flicker, s"]
    processes_flat: Annotated[float, "largest relative departure of their sum from 1/f"]


class CorrectDocument(TypedDict):
    """``correct FILE --json``: the corrected recording."""

    file: str
    run: str
    unit: str
    certificate: Annotated[StatedCertificate | None, "null: not certified"]
    samples: int
    outside_temperature: Annotated[int, "samples outside the measured temperatures"]
    temperatures_C: list[float]
    u_ug: Annotated[dict[str, float], "standard uncertainty of a sample, rms by axis"]
    u_contains: list[str]
    output: Annotated[str | None, "null: no file was written"]
    bias: Annotated[BiasTrack | None, "null: not tracked"]


class ProgrammedPose(TypedDict):
    """The verification of a programmed device in a pose."""

    pose: str
    temperature_C: float
    force_g: list[float]
    output: list[float]
    corrected_g: list[float]
    error_ug: list[float]
    magnitude_g: float
    from_archive_ug: Annotated[float, "largest difference from the correction with the archive's coefficients"]


class ProgrammedUnit(TypedDict):
    """The outcome of one device."""

    unit: str
    outcome: Literal["begun", "proved", "failed"]
    step: Annotated[str, "the step that failed, or the last"]
    reason: str
    copy: Annotated[str, "A or B"]
    sequence: int | None
    form: Annotated[str | None, "float32 or q24"]
    crc32: str
    bytes: int
    offsets: Annotated[list[int] | None, "steps of the offset registers"]
    poses: list[ProgrammedPose]
    certificate: Annotated[str | None, "the certificate of the coefficients; null: none"]


class ProgramDocument(TypedDict):
    """``program RUN --json``: coefficients written into the memory of devices, and their verification."""

    run: str
    units: list[ProgrammedUnit]
