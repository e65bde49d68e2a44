"""The state of a page: its address, and the command line that gives the same numbers.

``parse`` after ``address`` is the identity. Invalid parts of an address are ignored, with a message on the page.
"""

import shlex
from collections.abc import Iterable, Mapping
from datetime import date
from typing import Annotated, Any, ClassVar, Literal, Self
from urllib.parse import urlencode

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from schemas.foreign import shown
from schemas.toml_files import reason_of

Text = Annotated[str, Field(max_length=200)]
Texts = Annotated[tuple[Annotated[str, Field(min_length=1, max_length=400)], ...], Field(max_length=60)]
Day = Annotated[
    str, Field(pattern=r"^(\d{4}-\d\d-\d\d)?$"), AfterValidator(lambda day: day and str(date.fromisoformat(day)))
]
Outcome = Literal["", "pass", "fail", "refused"]

ROWS = 50
ORDERS = {
    "measured": "measured DESC, unit",
    "unit": "unit, measured DESC",
    "outcome": "outcome, unit",
    "station": "station, unit",
}
"""Units on a page of the search, and their orders in SQL."""


def quoted(text: str) -> str:
    """A text as a literal of SQL."""
    return "'" + text.replace("'", "''").replace("\0", "") + "'"


def like(text: str) -> str:
    """A pattern that finds a text anywhere, with its special characters escaped."""
    plain = text.replace("!", "!!").replace("%", "!%").replace("_", "!_")
    return f"{quoted(f'%{plain}%')} ESCAPE '!'"


def options(values: Mapping[str, str]) -> list[str]:
    """Options of a command line with their values; options without a value are omitted."""
    return [word for name, value in values.items() if value for word in (name, value)]


class PageState(BaseModel):
    """Base of the states."""

    model_config = ConfigDict(frozen=True, extra="ignore")
    PATH: ClassVar[str] = "/"

    @classmethod
    def parse(cls, query: Iterable[tuple[str, str]]) -> tuple[Self, list[str]]:
        """The state of an address, and a message for every invalid part."""
        values: dict[str, Any] = {}
        for name, value in query:
            if name in cls.model_fields:
                several = "tuple" in str(cls.model_fields[name].annotation)
                values[name] = tuple(dict.fromkeys((*values.get(name, ()), value))) if several else value
        problems: list[str] = []
        while True:
            try:
                return cls.model_validate(values), problems
            except ValidationError as problem:
                for error in problem.errors():
                    name = str(error["loc"][0])
                    if name in values:
                        given = shown(str(error["input"]), 60)
                        problems.append(
                            f"address: {name} = {given} cannot be used ({reason_of(error).lower()}); it is ignored"
                        )
                        del values[name]

    def query(self, **changes: Any) -> str:
        """The address' part behind the question mark, with some values changed; default values are omitted."""
        new = self.model_copy(update=changes) if changes else self
        pairs: list[tuple[str, str]] = []
        for name, about in type(self).model_fields.items():
            value = getattr(new, name)
            if value != about.default:
                pairs += [(name, str(item)) for item in (value if isinstance(value, tuple) else (value,))]
        return urlencode(pairs)

    def address(self, **changes: Any) -> str:
        """The address of the page, with some values changed."""
        query = self.query(**changes)
        return f"{self.PATH}?{query}" if query else self.PATH

    def figure(self, name: str, ending: str = "json", **changes: Any) -> str:
        """The address of a figure of the page, or of its numbers."""
        query = self.query(**changes)
        return f"{self.PATH}/figure/{name}.{ending}" + (f"?{query}" if query else "")

    def arguments(self) -> list[str]:
        """The command that gives the same numbers, without the archive."""
        return []

    def command(self, archive: str) -> str:
        """The command line that gives the same numbers."""
        arguments = self.arguments()
        return shlex.join(["tumbleline", *arguments, "--archive", archive]) if arguments else ""


class UnitsPage(PageState):
    """A search of runs and units."""

    PATH: ClassVar[str] = "/units"
    search: Text = ""
    outcome: Outcome = ""
    station: Text = ""
    device: Text = ""
    since: Day = ""
    until: Day = ""
    order: Literal["measured", "unit", "outcome", "station"] = "measured"
    runs: Literal["", "unfinished", "finished", "all passed", "not all passed", "adequate", "not adequate"] = ""
    page: Annotated[int, Field(ge=1, le=100_000)] = 1

    def arguments(self) -> list[str]:
        """A question in SQL."""
        return ["archive", "query", self.question()]

    def question(self, most: int = ROWS) -> str:
        """The question in SQL for a page of units with their runs."""
        return (
            "SELECT unit, outcome, grade, slot, run, measured, station, device "  # noqa: S608 - texts are quoted
            "FROM units JOIN runs USING (run) "
            f"WHERE {self.conditions()} ORDER BY {ORDERS[self.order]} LIMIT {most} OFFSET {(self.page - 1) * ROWS}"
        )

    def conditions(self) -> str:
        """The conditions of the search in SQL."""
        parts: list[str] = []
        if self.search:
            pattern = like(self.search.lower())
            parts.append(f"(lower(unit) LIKE {pattern} OR lower(run) LIKE {pattern})")
        chosen = {"outcome": self.outcome, "station": self.station, "device": self.device}
        parts += [f"{column} = {quoted(value)}" for column, value in chosen.items() if value]
        if self.since:
            parts.append(f"measured >= {quoted(self.since)}")
        if self.until:
            parts.append(f"measured < {quoted(self.until + 'T99')}")
        return " AND ".join(parts) or "true"


class RunPage(PageState):
    """A run: its units against their limits.

    beside : another run, whose figures stand beside
    """

    PATH: ClassVar[str] = "/run"
    run: Text = "latest"
    beside: Text = ""

    def arguments(self) -> list[str]:
        """The run's summary, or the differences between the two."""
        return ["archive", "diff", self.run, self.beside] if self.beside else ["show", self.run]


class UnitPage(PageState):
    """A unit of a run.

    against : what the residuals are drawn against; empty for what they depend on most, force where the model is adequate
    """

    PATH: ClassVar[str] = "/unit"
    run: Text = "latest"
    unit: Text = ""
    against: Text = ""
    dwell: Text = ""
    parameter: Text = "bias x"

    def arguments(self) -> list[str]:
        """The table of residuals; the summary of a run without them."""
        return ["show", self.run, "residuals"] if self.against else ["show", self.run]


class MissingPage(PageState):
    """A model against dwells: adequacy, drivers of the residual, missing effects.

    source, fresh : runs of the archive, or files of the workbench's folder
    effects : the model to begin with; empty for the run's own, or the default one · added : effects that were added to it
    without : dwells left out, ``UNIT:DWELL`` · formula : formulas, ``id = expression``
    """

    PATH: ClassVar[str] = "/missing"
    source: Text = ""
    fresh: Text = ""
    effects: Texts = ()
    added: Texts = ()
    without: Texts = ()
    formula: Texts = ()
    unit: Text = ""
    against: Text = ""
    colour: Literal["axis", "direction", "slot"] = "axis"
    dwell: Text = ""

    @property
    def judged(self) -> tuple[str, ...]:
        """The effects of the model that is judged; empty for that of the source."""
        return (*self.effects, *self.added)

    def arguments(self) -> list[str]:
        """The diagnosis."""
        if not self.source:
            return []
        formulas = [word for text in self.formula for word in ("--formula", text)]
        words = ["diagnose", self.source, *options({"--effects": ",".join(self.judged)}), *formulas]
        return words + options({"--leave-out": ",".join(self.without)})

    def ladder_command(self, archive: str) -> str:
        """The command line for the errors of the model in its present state."""
        words = self.arguments()[1:] + options({"--fresh": self.fresh})
        return shlex.join(["tumbleline", "compare", *words, "--archive", archive]) if self.source else ""


class TwoModelsPage(PageState):
    """Two models on the same dwells.

    source : a run, or a file of the workbench's folder · first, second : names of model files; empty for the source's own model
    added : effects that the second has besides
    """

    PATH: ClassVar[str] = "/two-models"
    source: Text = "latest"
    first: Text = ""
    second: Text = ""
    added: Texts = ()
    unit: Text = ""
    against: Text = ""


class UploadPage(PageState):
    """A file, and the interpretation of its columns."""

    PATH: ClassVar[str] = "/upload"
    file: Text = ""
    rows: Literal["samples", "dwells"] = "samples"
    columns: Texts = ()
    output: Text = ""
    time: Text = "s"
    temperature: Text = "degC"
    serial: Text = ""
    rate: Annotated[float, Field(ge=0.0, le=1e6, allow_inf_nan=False)] = 0.0
    gravity: Annotated[float, Field(ge=0.0, le=20.0, allow_inf_nan=False)] = 0.0
    poses: Text = ""
    fit: Literal["", "norm", "faces", "temperature"] = "norm"
    run: Text = ""

    def arguments(self) -> list[str]:
        """The import."""
        if not self.file:
            return []
        units = {"output": self.output, "time": self.time, "temperature": self.temperature}
        usual = {("output", ""), ("time", "s"), ("temperature", "degC")}
        values = {
            "--map": ",".join(self.columns),
            "--unit-of": ",".join(f"{name}={unit}" for name, unit in units.items() if (name, unit) not in usual),
            "--units": self.serial,
            "--rate": repr(self.rate) if self.rate else "",
            "--fit": self.fit,
        }
        keys = {
            "rows": self.rows if self.rows != "samples" else "",
            "local_gravity_m_s2": repr(self.gravity) if self.gravity else "",
            "poses": self.poses,
        }
        stated = [word for key, value in keys.items() if value for word in ("--set", f"{key}={value}")]
        return ["import", self.file, *options(values), *stated]


class ModelsPage(PageState):
    """Model files: their versions, their effect on the lots of the archive, and releases to the line.

    model : a name among the model files · evaluate : whether the lots are computed with it
    """

    PATH: ClassVar[str] = "/models"
    model: Text = ""
    evaluate: Literal["", "yes"] = ""

    def arguments(self) -> list[str]:
        """The what-if, or the list of releases."""
        return ["release", *(["whatif", f"{self.model}.toml"] if self.model else [])]


class PlanPage(PageState):
    """A recipe: visible effects and station time.

    pose : poses at other angles than in the recipe, ``NAME=OUTER,INNER`` · edit : the pose whose angles are in the form
    search : part of the effects' names or texts · only : whether the effects that are seen are left out
    """

    PATH: ClassVar[str] = "/plan"
    recipe: Text = "production"
    effects: Texts = ()
    pose: Texts = ()
    edit: Text = ""
    search: Text = ""
    only: Literal["", "unseen"] = ""

    def arguments(self) -> list[str]:
        """The plan."""
        words = ["plan", self.recipe, *options({"--effects": ",".join(self.effects)})]
        return words + [word for text in self.pose for word in ("--pose", text)]


class StationPage(PageState):
    """The station of a run: events, temperatures over time."""

    PATH: ClassVar[str] = "/station"
    run: Text = "latest"
    recording: Text = ""

    def arguments(self) -> list[str]:
        """The station's log."""
        return ["station", "log", self.run]


class AuditPage(PageState):
    """Drift and calibrations due."""

    PATH: ClassVar[str] = "/audit"
    since: Day = ""
    until: Day = ""
    device: Text = ""
    station: Text = ""
    finding: Text = ""

    def arguments(self) -> list[str]:
        """The audit."""
        return [
            "audit",
            *options({f"--{name}": getattr(self, name) for name in ("since", "until", "device", "station")}),
        ]


class DiscoverPage(PageState):
    """What the lots of the archive show together.

    discovery : id of one that is shown with its levels; empty for the first
    """

    PATH: ClassVar[str] = "/discover"
    device: Text = ""
    discovery: Text = ""

    def arguments(self) -> list[str]:
        """The search."""
        return ["discover", *options({"--device": self.device})]


class OperatorPage(PageState):
    """Lots on the stations.

    lot : id of a lot; empty for the one under way · station : name of a station; empty for the first
    """

    PATH: ClassVar[str] = "/operator"
    lot: Text = ""
    station: Text = ""
