"""``tumbleline plan keys``: the keys and names that recipes, limits, stations, lines, --fault and demo accept."""

from collections.abc import Callable
from typing import Annotated

from pipelines.cli.options import JsonOption, argument
from pipelines.cli.printing import give, print_table, say
from schemas.errors import WrongUse, did_you_mean


def keys(
    subject: Annotated[
        str, argument("[SUBJECT]", "recipe, limits, station, line, fault, demo or names; all in short by default.")
    ] = "",
    *,
    as_json: JsonOption = False,
) -> None:
    """List what a recipe, limits, station or line file may contain, what --fault and demo accept, and the names of files.

    The same lists are on the page docs/reference/keys.md.
    """
    if subject and subject not in SUBJECTS:
        raise WrongUse(f"plan keys: no list is called '{subject}'; {did_you_mean(subject, SUBJECTS)}")
    subjects = [{"subject": name, "meaning": text} for name, (text, _) in SUBJECTS.items()]
    rows = SUBJECTS[subject][1]() if subject else subjects
    give({"subject": subject, "rows": rows}, lambda _: _print(rows), as_json=as_json)


def _print(rows: list[dict[str, str]]) -> None:
    """Rows in two columns, name and meaning, with one table for each table of the file."""
    for table in dict.fromkeys(row.get("table", "") for row in rows):
        of_table = [row for row in rows if row.get("table", "") == table]
        head = next(name for name in of_table[0] if name != "table")
        lines = [[row[head], _text(row, head)] for row in of_table]
        print_table([head, "meaning"], lines, f"[{table}]" if table else "")
    if rows and "subject" in rows[0]:
        say("tumbleline plan keys SUBJECT shows a list")


def _text(row: dict[str, str], head: str) -> str:
    """The meaning of a row, followed by its other values with their column names."""
    meaning = row.get("meaning", "")
    more = [f"{name}: {value}" for name, value in row.items() if value and name not in {head, "table", "meaning"}]
    return f"{meaning} {'; '.join(more)}".strip()


def _keys(name: str) -> Callable[[], list[dict[str, str]]]:
    def rows() -> list[dict[str, str]]:
        from schemas.key_list import FILES, keys_of

        return [
            {"table": key.table, "key": key.name, "value": key.value, "default": key.default, "meaning": key.meaning}
            for key in keys_of(FILES[name])
        ]

    return rows


def _faults() -> list[dict[str, str]]:
    from stations.plant.faults.catalogue import fault_rows

    return fault_rows()


def _hidden() -> list[dict[str, str]]:
    from pipelines.demo.scenes import SCENES

    return [
        {
            "hidden effect": scene.kind,
            "effect of the catalogue": scene.effect,
            "parameters": ", ".join(f"{name} = {value:g}" for name, value in scene.figures.items()),
            "meaning": f"{scene.truth[:1].upper()}{scene.truth[1:]}.",
        }
        for scene in SCENES
    ]


def _names() -> list[dict[str, str]]:
    from pipelines.jobs.recipes import sample_names
    from schemas.own_files import KINDS, own_files
    from schemas.station import BUILT_IN
    from stations.plant.preset import built_in_presets
    from stations.profile_files import built_in_profiles

    built_in = {
        "recipes": sample_names(),
        "limits": sample_names("limits-"),
        "stations": [BUILT_IN],
        "profiles": built_in_profiles(),
        "presets": built_in_presets(),
    }
    return [
        {"table": kind, "name": name, "meaning": file}
        for kind in KINDS
        for name, file in [
            *((name, "built in") for name in built_in[kind]),
            *((name, str(path)) for name, path in own_files(kind).items()),
        ]
    ]


SUBJECTS: dict[str, tuple[str, Callable[[], list[dict[str, str]]]]] = {
    "recipe": ("keys of a recipe file", _keys("recipe")),
    "limits": ("keys of a limits file", _keys("limits")),
    "station": ("keys of a station file", _keys("station")),
    "line": ("keys of a line file, of 'plan line'", _keys("line")),
    "fault": ("kinds of --fault KIND:KEY=VALUE, with their keys", _faults),
    "demo": ("hidden effects of 'tumbleline demo NAME'", _hidden),
    "names": ("recipes, limits, stations, profiles and presets, built in and of your own", _names),
}
"""The lists by subject: description and rows."""
