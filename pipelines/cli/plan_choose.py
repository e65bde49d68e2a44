"""``tumbleline plan choose``: which kind of device, with which calibration, reaches an error that an application asks for."""

from typing import Annotated

from pipelines.cli.options import JsonOption, Setting, argument, option, settings
from pipelines.cli.printing import conclude, print_table, say, short
from pipelines.planning.documents import ChoiceDocument, ChoiceRow
from schemas.errors import WrongUse

NEEDS = {
    "range": Setting("4g", ""),
    "error": Setting("2mg", ""),
    "temperature": Setting("-40..85", ""),
    "bandwidth": Setting("100", "", float),
}


def choose(
    need: Annotated[
        list[str],
        argument(
            "NEED…",
            "range=4g (largest specific force), error=2mg (allowed, k = 2), temperature=-40..85 (of use, °C; 25 by default), "
            "bandwidth=100 (of use, Hz; 10 by default: it sets noise and what must pass).",
        ),
    ],
    device: Annotated[str, option("--device A,B", "Presets to compare; all by default.")] = "",
    *,
    as_json: JsonOption = False,
) -> None:
    """Compare presets and calibrations with a need: an uncertainty budget at the end of the range, with its largest term.

    Exit status 1: no preset reaches the error.
    """
    from pipelines.planning.choice import choice, need_of

    given = settings(need, NEEDS, "plan choose", "")
    if missing := [key for key in ("range", "error") if key not in given]:
        raise WrongUse(
            f"plan choose: {missing[0]} is not given, it is needed; add {missing[0]}={NEEDS[missing[0]].notation}"
        )
    asked = need_of(given["range"], given.get("temperature", "25..25"), given["error"], given.get("bandwidth", 10.0))
    document = choice(asked, [name.strip() for name in device.split(",") if name.strip()])
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
    printed: set[str] = set()
    shown: list[ChoiceRow] = []
    for row in rows:
        if not row["cannot"]:
            shown.append(row)
        elif row["device"] not in printed:
            printed.add(row["device"])
            shown.append({**row, "calibration": "any"})
    return shown
