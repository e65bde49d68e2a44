"""Imports in the terminal: what was read, the remarks, the dwells, the verdict on the fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from inertial.counts import number_of
from pipelines.cli.next_commands import archive_words, command_line, print_next
from pipelines.cli.printing import print_table, say, short, short_values
from pipelines.cli.text.verdict_text import print_verdict_of_fit


def print_transfers(imports: Sequence[Mapping[str, Any]]) -> None:
    """Imported transfer functions for people."""
    for one in imports:
        say(f"{one['unit']}: {one['points']} points, kept as run {one['run']}")
        for line in one["text"]:
            say(f"  {line}")
        print_verdict_of_fit(one["adequate"], "the model does not describe these points")


def print_waveforms(imported: Mapping[str, Any]) -> None:
    """Imported recordings of a test procedure for people."""
    say(f"{imported['unit']}: {imported['records']} recordings, kept as run {imported['run']}")
    rows = [
        [one["figure"], one["axis"], short(one["value"]), short(one["uncertainty"]), one["unit"], one["note"]]
        for one in imported["figures"]
    ]
    print_table(["figure", "axis", "value", "standard uncertainty", "unit", "remark"], rows, whole=2)
    for line in imported["text"]:
        say(f"  {line}")


def print_imports(imports: Sequence[dict[str, Any]], archive: str | None, _: object, *, list_dwells: bool) -> None:
    """Imports for people."""
    for one in imports:
        dwells = number_of(one["dwells"], "dwell")
        rows = f"{number_of(one['samples'], 'sample')}, {dwells}" if one["samples"] else dwells
        say(f"{', '.join(one['units'])}: {rows} in {one['out_unit']}, kept as run {one['run']}")
        for remark in [*one["remarks"], *one["lines"]]:
            say(f"  {remark}")
        if list_dwells:
            _print_dwells(one["dwell_list"], one["out_unit"])
        if one["fit"]:
            print_verdict_of_fit(one["adequate"], "this fit does not describe these data")
            if one["fit"] == "norm" and one["adequate"] is False:
                print_next([command_line("diagnose", one["run"], *archive_words(archive))])


def _print_dwells(dwells: list[dict[str, Any]], unit: str) -> None:
    heads = ["dwell", "label", "start, s", "end, s", "samples", f"mean x / y / z, {unit}", f"sd x / y / z, {unit}",
             "residual, µg", "influence"]  # fmt: skip
    print_table(
        heads,
        [
            [
                str(one["dwell"]),
                one["label"],
                f"{one['start_s']:.2f}",
                f"{one['end_s']:.2f}",
                "" if one["n"] is None else str(one["n"]),
                " / ".join(f"{value:.6g}" for value in one["mean"]),
                "" if one["sd"] is None else short_values(one["sd"]),
                "" if one["residual_ug"] is None else f"{one['residual_ug']:.1f}",
                short(one["influence"]),
            ]
            for one in dwells
        ],
        whole=2,
    )
