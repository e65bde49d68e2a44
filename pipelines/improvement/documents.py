"""The JSON document of improve: keys that other programs read. A NotRequired key may be missing."""

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict

from pipelines.diagnosis.documents import DiagnosisDocument, JudgedVersion


class ImprovementChoice(TypedDict):
    """The decision on one class of the diagnosis."""

    effect: str
    not_separated_from: Annotated[list[str], "effects of the class that these data do not separate from it"]
    decided_by: Annotated[
        Literal["question", "--effect", "--yes", "undecided"], "`undecided`: a class of several, without an answer"
    ]
    added: bool


class LadderRow(JudgedVersion):
    """The errors of one version of the model."""

    noise_ug: Annotated[float, "noise of the measurement by the last diagnosis, µg"]


class RecordingDocument(TypedDict):
    """A recording of another system as it was recognised and imported."""

    files: list[str]
    form: str
    rows: int
    columns: Annotated[dict[str, str], "meaning → column"]
    reason: Annotated[str, "why these three columns are the axes"]
    output_unit: str
    output_reason: str
    rate_hz: Annotated[float | None, "null: the file has no clock"]
    dwells: int
    assumed: Annotated[list[str], "what the file does not state and was taken"]
    remarks: list[str]
    command: Annotated[str, "the import that says the same"]
    run: str
    fit: Literal["norm", "faces"] | None
    lines: Annotated[list[str], "the fit in words"]
    dwell_list: Annotated[list[dict[str, Any]], "as in `import --json`"]


class ImproveDocument(TypedDict):
    """``improve --json``: diagnosis of a model, effects added to it, and the error of each version."""

    data: str
    recording: NotRequired[Annotated[RecordingDocument, "where DATA is a recording of another system"]]
    file: Annotated[str | None, "the model file; null: none was given and none written"]
    diagnosis: Annotated[DiagnosisDocument, "of the model to begin with"]
    choices: Annotated[list[ImprovementChoice], "one per class with a recommended effect"]
    added: list[str]
    effects: Annotated[list[str], "the resulting model"]
    after: Annotated[DiagnosisDocument | None, "of the resulting model; null: nothing was added"]
    adequate: Annotated[bool | None, "whether the resulting model is adequate; null: cannot be judged"]
    ladder: Annotated[list[LadderRow], "oldest version first; empty if no unit can be judged"]
    refuted: Annotated[list[str], "added effects that the fresh run is evidence against"]
    warnings: list[str]
    fresh: Annotated[str | None, "the fresh run that judged the last version; null: there was none"]
    next: Annotated[list[str], "commands to give next"]
