"""``tumbleline choose``: which kind of device, with which calibration, reaches an error that an application asks for."""

from typing import Annotated

from pipelines.cli.options import JsonOption, option
from pipelines.cli.printing import conclude, print_table, say, short
from pipelines.planning.documents import ChoiceDocument, ChoiceRow

PART = "Measure"
ORDER = 115
SUMMARY = "Choose the kind of device and the calibration that reach an error."
EXAMPLES = (
    "tumbleline choose --range 4g --temperature -40..85 --error 2mg --bandwidth 100",
    "tumbleline choose --range 30g --error 5mg --device QA700,SF1500",
)


def command(
    span: Annotated[str, option("--range G", "Largest specific force, such as 4g.")],
    error: Annotated[str, option("--error MG", "Error that is allowed (k = 2), such as 2mg.")],
    temperature: Annotated[str, option("--temperature LOW..HIGH", "Temperatures of use, °C.")] = "25..25",
    bandwidth: Annotated[
        float, option("--bandwidth HZ", "Bandwidth of use, Hz: it sets noise and what must pass.")
    ] = 10.0,
    device: Annotated[str, option("--device A,B", "Presets to compare; all by default.")] = "",
    *,
    as_json: JsonOption = False,
) -> None:
    """Compare presets and calibrations with a need: an uncertainty budget at the end of the range, with its largest term.

    Exit status 1: no preset reaches the error.
    """
    from pipelines.planning.choice import choice, need_of

    need = need_of(span, temperature, error, bandwidth)
    document = choice(need, [name.strip() for name in device.split(",") if name.strip()])
    conclude(document, _print, as_json=as_json, passed=any(row["reaches"] for row in document["candidates"]))


def _print(document: ChoiceDocument) -> None:
    low, high = document["temperatures_C"]
    say(
        f"asked for: ± {document['range_g']:g} g, {low:g} to {high:g} °C, {document['bandwidth_hz']:g} Hz, error "
        f"{short(document['error_ug'])} µg (k = {document['coverage_factor']:g})"
    )
    rows = [
        [
            row["device"],
            row["calibration"],
            "yes" if row["reaches"] else "no",
            short(row["error_ug"]),
            short(row["range_over_noise_dB"]),
            "; ".join(row["why"]) or f"{largest}: {short(2.0 * row['terms_ug'][largest])} µg",
        ]
        for row in _shown(document["candidates"])
        for largest in [max(row["terms_ug"], key=row["terms_ug"].__getitem__)]
    ]
    print_table(
        ["device", "calibration", "reaches", "error\nµg", "range\nover\nnoise\ndB", "largest term, or why not"], rows
    )
    first = next((row for row in document["candidates"] if row["reaches"]), None)
    if first is None:
        say(
            "no preset reaches it; a smaller bandwidth, range or span of temperature, or another device is needed",
            style="yellow",
        )
    else:
        say(
            f"{first['device']}, {first['calibration']}: {document['calibrations'][first['calibration']]}",
            style="green",
        )
    for text in document["assumptions"]:
        say(f"assumed: {text}", style="dim")


def _shown(rows: list[ChoiceRow]) -> list[ChoiceRow]:
    """The rows without those of a device that no calibration mends, but for one."""
    told: set[str] = set()
    shown: list[ChoiceRow] = []
    for row in rows:
        if not row["cannot"]:
            shown.append(row)
        elif row["device"] not in told:
            told.add(row["device"])
            shown.append({**row, "calibration": "any"})
    return shown
