"""Lots a day of a line with one tilt table and one, two or three fixtures with a chamber each: `production` and `quick`.

Ten lots, one operator round the clock, 6 min to load, 4 to unload, 3 min by hand to change the fixture on the table. The
schedule is the shortest one; the times are those that the plan predicts.
"""

from __future__ import annotations

import argparse
import time

from pipelines.jobs.recipes import load_recipe
from pipelines.planning.line_document import plan_line
from schemas.line import Line
from schemas.station import load_station

RECORD_ELSEWHERE = {"beside it": ["measure"], "on the table": ["measure", "static"]}


def line(recipe: str, fixtures: int, needed_for: list[str], lots: int) -> Line:
    return Line.model_validate(
        {
            "name": "bench",
            "fixtures": [f"F{k}" for k in range(fixtures)],
            "load_min": 6,
            "unload_min": 4,
            "shared": [{"name": "table", "needed_for": needed_for, "change_min": 3, "by_hand": True}],
            "lots": [{"recipe": recipe, "count": lots}],
        }
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lots", type=int, default=10)
    parser.add_argument("--most", type=int, default=3, help="fixtures")
    given = parser.parse_args()
    print("recipe      static record  fixtures  min per lot  lots a day  no less than  table needs  s of processor")
    for recipe in ("production", "quick"):
        for where, needed_for in reversed(RECORD_ELSEWHERE.items()):
            for fixtures in range(1, given.most + 1):
                begin = time.process_time()
                found = plan_line(line(recipe, fixtures, needed_for, given.lots), load_station(), load_recipe)
                table = next(row for row in found["resources"] if row["resource"] == "table")
                least = found["bound_min"] / given.lots
                print(
                    f"{recipe:11s} {where:14s} {fixtures:8d} {found['minutes_per_lot']:12.1f} {found['lots_per_day']:11.1f} "
                    f"{least:13.1f} {table['bound_per_lot_min']:12.1f} {time.process_time() - begin:6.1f}"
                )


if __name__ == "__main__":
    main()
