"""Options and arguments that several commands share."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from schemas.errors import WrongUse, close_matches, did_you_mean
from schemas.foreign import shown


def option(notation: str, text: str, **checks: Any) -> Any:
    """An option of a command.

    notation : its names, then what stands for its value, as the help shows them: ``--output -o FILE``
    text : what it does
    checks : ``min``, ``max``, ``callback`` and others of :class:`typer.Option`
    """
    words = notation.split()
    names = [word for word in words if word.startswith("-")]
    return typer.Option(*names, metavar=" ".join(words[len(names) :]) or None, help=text, **checks)


def argument(notation: str, text: str) -> Any:
    """An argument of a command: what stands for it in the help, and what it is."""
    return typer.Argument(metavar=notation, help=text)


def names_in(listed: str) -> tuple[str, ...]:
    """The names that an option lists, divided by commas, each once."""
    return tuple(dict.fromkeys(part.strip() for part in listed.split(",") if part.strip()))


def mapped_outputs(given: Sequence[str] | None) -> tuple[str, list[str]]:
    """The column of the time, empty where none is named, and those of the outputs from ``--map``: x, y, z, then in their order.

    Raises WrongUse: a meaning is not known here.
    """
    named, alone = dict[str, str](), list[str]()
    for part in filter(None, (piece.strip() for text in given or () for piece in text.split(","))):
        meaning, equals, column = (piece.strip() for piece in part.partition("="))
        if equals and meaning not in MAPPED:
            raise WrongUse(
                f"--map: found '{shown(part)}', one of {', '.join(MAPPED)} is needed before the '='; correct it"
            )
        if equals:
            named[meaning] = column
        else:
            alone.append(part)
    return named.get("time", ""), [*(named[axis] for axis in MAPPED[1:] if axis in named), *alone]


MAPPED = ("time", "x", "y", "z")


def filter_of(text: str) -> tuple[str, float | None]:
    """Kind and cut-off frequency, Hz, of ``--filter KIND[:HZ]``; None where the text has no frequency.

    Raises WrongUse: the frequency is no positive number.
    """
    kind, colon, number = text.partition(":")
    try:
        cutoff = float(number) if colon else None
    except ValueError:
        cutoff = math.nan
    if not kind or (cutoff is not None and not 0.0 < cutoff < math.inf):
        raise WrongUse(f"--filter: found '{shown(text)}', KIND or KIND:HZ is needed, as butterworth:50; correct it")
    return kind, cutoff


def included(given: Sequence[str] | None) -> dict[str, bool]:
    """The units that ``--include`` adds: ``failed`` and ``revoked``, each whether it is named.

    Raises WrongUse: another word.
    """
    chosen = {"failed": False, "revoked": False}
    for name in names_in(",".join(given or ())):
        if name not in chosen:
            raise WrongUse(f"--include: found '{shown(name)}'; {did_you_mean(name, chosen)}")
        chosen[name] = True
    return chosen


class Setting(NamedTuple):
    """A key of ``--set``: what stands for its value, what it does, how it is read, and its bounds."""

    notation: str
    text: str
    read: Callable[[str], Any] = str
    least: float = -math.inf
    most: float = math.inf


def yes(text: str) -> bool:
    """The value of a key that is on or off. Raises ValueError: neither."""
    return ("no", "yes").index(text.lower()) == 1


def set_option(keys: Mapping[str, Setting], text: str = "Further settings; may be repeated.") -> Any:
    """The option ``--set``, whose help lists its keys."""
    lines = [f"{key}={setting.notation}: {setting.text}." for key, setting in keys.items()]

    def offered(incomplete: str) -> list[str]:
        return [f"{key}=" for key in keys if key.startswith(incomplete)]

    return option("--set KEY=VALUE", "\n\n".join([text, *lines]), autocompletion=offered)


def settings(
    given: Sequence[str] | None, keys: Mapping[str, Setting], where: str, name: str = "--set "
) -> dict[str, Any]:
    """The values of ``--set`` by key; of a key that is given twice the last one.

    name : of the option in messages

    Raises WrongUse: a key is not known, or its value is not of its kind.
    """
    values: dict[str, Any] = {}
    for text in given or ():
        key, equals, value = (part.strip() for part in text.partition("="))
        if key not in keys or not equals:
            why = did_you_mean(key, keys) if equals else "KEY=VALUE is needed"
            raise WrongUse(f"{where}: {name}{shown(text)}: '{shown(key)}' is no key with a value; {why}")
        known = keys[key]
        try:
            values[key] = known.read(value)
        except ValueError:
            values[key] = math.nan
        if isinstance(values[key], int | float) and not (
            known.least <= values[key] <= known.most and values[key] < math.inf
        ):
            least = f" of {known.least:g} or more" if known.least > -math.inf else ""
            most = f", {known.most:g} at most" if known.most < math.inf else ""
            needed = "yes or no" if known.read is yes else f"a number{least}{most}"
            raise WrongUse(f"{where}: {name}{key}: found '{shown(value)}', {needed} is needed; correct it")
    return values


STANDARD_OUTPUT = Path("-")  # the name of standard output in place of a file, as the programs of a system understand it
PICTURES, PAGES = (".svg", ".png", ".pdf"), (".html", ".htm")


def outputs(given: Sequence[Path] | None, kinds: Mapping[str, Sequence[str]], where: str) -> dict[str, Path]:
    """The files of ``--output`` by kind, which their endings state.

    kinds : endings of each kind; an empty one is a folder, ``-`` is standard output
    Raises WrongUse: a file has another ending, or two are of a kind.
    """
    files: dict[str, Path] = {}
    for path in given or ():
        ending = "-" if path == STANDARD_OUTPUT else path.suffix.lower()
        kind = next((kind for kind, endings in kinds.items() if ending in endings), None)
        if kind is None or kind in files:
            named = "; ".join(
                f"{kind}: {', '.join(end or 'no ending, a folder' for end in endings)}"
                for kind, endings in kinds.items()
            )
            why = "the ending says nothing that can be written" if kind is None else f"a second {kind}"
            raise WrongUse(f"{where}: --output {shown(str(path))}: {why}; name one file of each kind ({named})")
        files[kind] = path
    return files


ArchiveOption = Annotated[
    str | None,
    option("--archive DIR", "Folder or address (s3://…) of the archive; TUMBLELINE_ARCHIVE or ./archive by default."),
]
AllOption = Annotated[bool, option("--all", "Print the long tables, too.")]
RecordOption = Annotated[
    Path | None, option("--record FILE", "Record every message to and from the devices in this new file.")
]
READING = {
    "join": Setting("rows|columns", "join several files into one recording"),
    "group": Setting("NAME", "group of channels, if the file has several"),
}
"""Keys of ``--set`` for the reading of files."""
JsonOption = Annotated[bool, option("--json", "Print one JSON document and nothing else.")]
RecipeArgument = Annotated[str, argument("[RECIPE]", "A recipe file or a built-in recipe.")]
StationOption = Annotated[Path | None, option("--station FILE", "The station; the built-in simulated one by default.")]
SeedOption = Annotated[int | None, option("--seed", "Seed of a simulated station.")]
RepeatOption = Annotated[
    int, option("--repeat", "Measure the same lot once more: 1 is the first repetition, 2 the second.", min=0)
]
RunArgument = Annotated[str, argument("RUN", "A run's name, its beginning, or 'latest'.")]
DwellsArgument = Annotated[str, argument("DWELLS", "A file in the exchange format, or a run of the archive.")]
EffectsOption = Annotated[
    str,
    option(
        "--effects a,b,c",
        "The model as a list of effects; default: that of the run; of a file bias, scale, misalignment, "
        "and terms in temperature where it changes by more than 5 °C.",
    ),
]
ModelOption = Annotated[Path | None, option("--model FILE", "The model as a model file.")]
TemperaturesOption = Annotated[
    str, option("--temperatures FILE", "Temperatures against time; a run of the archive has its own.")
]
WhoOption = Annotated[str, option("--who NAME", "Author of the change; the user's name by default.")]
ReasonOption = Annotated[str, option("--reason TEXT", "Reason, which is kept with the change.")]
SinceOption = Annotated[str, option("--since DATE", "First day of validity, UTC; default: today.")]
TrustOption = Annotated[
    list[str] | None,
    option(
        "--trust FILE|HEX",
        "Whose signature is accepted: the public key of an archive, or the certificate (.pem) of a laboratory or of its "
        "authority; may be repeated.",
    ),
]
IncludeOption = Annotated[
    list[str] | None,
    option("--include failed,revoked", "Also units that failed their limits, or whose calibration was revoked."),
]
FilterOption = Annotated[
    str,
    option(
        "--filter KIND[:HZ]",
        "Low-pass behind the correction: butterworth, fir or moving-average, with its -3 dB frequency; without one the "
        "bandwidth that a run measured.",
    ),
]
FreshOption = Annotated[str, option("--fresh DWELLS2", "The same units measured again: never fitted, only predicted.")]
FreshTemperaturesOption = Annotated[
    str, option("--fresh-temperatures FILE", "Temperatures against time of the fresh run.")
]
OtherEffectsOption = Annotated[str, option("--effects a,b,c", "Another model, as a list of effects.")]
OtherLimitsOption = Annotated[str, option("--limits FILE", "Other limits: a file or a name.")]
SeriesArgument = Annotated[str, argument("FILE|RUN", "A file of samples at rest, or a run of the archive.")]
MapOption = Annotated[
    list[str] | None,
    option(
        "--map time=t,x=ax,…",
        "Meaning of the columns, by name or by number from 1; names alone are the outputs in their order.",
    ),
]
UnitOfOption = Annotated[
    list[str] | None, option("--unit-of output=g,time=ms", "Units of measure of the columns; the time in s by default.")
]
RateOption = Annotated[float | None, option("--rate HZ", "Sampling rate.", min=1e-9)]
StretchOption = Annotated[
    int | None, option("--stretch N", "Stretch at rest of an import; the longest by default.", min=1)
]
LeaveOutOption = Annotated[str, option("--leave-out UNIT:DWELL,…", "Dwells that are not judged or fitted.")]
EffectFileOption = Annotated[
    list[Path] | None, option("--effect-file FILE.py", "A Python file with effects of your own; may be repeated.")
]
FormulaOption = Annotated[
    list[str] | None,
    option(
        "--formula ID=EXPRESSION",
        "An effect as a formula over recorded quantities, to be named in --effects; may be repeated.",
    ),
]
SelectionArgument = Annotated[
    list[str],
    argument(
        "SELECTION…",
        "Names of runs or their beginnings, 'latest', 'all', device:…, station:…, unit:…, recipe:…, since:DATE, until:DATE.",
    ),
]
CalibrationArgument = Annotated[
    str, argument("[RUN:UNIT]", "The calibration: a run, latest by default, and one of its units.")
]
DaskOption = Annotated[
    str, option("--dask ADDRESS|local", "Work on Dask workers: of the scheduler at an address, or started here.")
]
WorkersOption = Annotated[
    int | None, option("--workers", "Processes on this machine; as many as it has cores by default.", min=1)
]
SimulatedDeviceOption = Annotated[str, option("--device", "Preset of the simulated devices under test.")]
SimulatedUnitsOption = Annotated[int, option("--slots", "Number of simulated devices in the slots.", min=1, max=32)]
_LONGEST_DEVICE = 64


def stated_device(name: str, again: str = "import again with it") -> tuple[str, tuple[str, ...]]:
    """The kind of device that ``--device`` states, a preset as it is spelled; and what is to be said of the name."""
    if not name:
        return "", ()
    from stations.plant.preset import preset_names

    if not (name.isprintable() and name == name.strip() and len(name) <= _LONGEST_DEVICE):
        raise WrongUse(
            f"--device: found '{shown(name)}', 1 to {_LONGEST_DEVICE} printable characters are needed; correct it"
        )
    known = preset_names()
    spelled = next((preset for preset in known if preset.lower() == name.lower()), name)
    close = close_matches(name, known) if spelled not in known else ()
    slip = f"device: {spelled} is not one that the program knows; {did_you_mean(name, close)} Then {again}"
    return spelled, (slip,) if close else ()
