"""The tables of a lot as files: `python -m benchmarks.strangers --write FOLDER KIND SEED`; without it, the kinds."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks.strangers import KINDS, make


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", nargs=3, metavar=("FOLDER", "KIND", "SEED"))
    parser.add_argument("--units", type=int, default=8)
    parser.add_argument("--size", type=float, default=2.0, help="RMS in multiples of the noise of a dwell")
    options = parser.parse_args()
    if options.write is None:
        for kind in KINDS.values():
            print(f"{kind.world:7} {kind.name:25} {kind.change.__doc__}")
        return
    folder, name, seed = options.write
    if name not in KINDS:
        parser.error(f"kind: found {name}, needed is one of {', '.join(KINDS)}")
    lot = make(name, int(seed), options.units, options.size)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    tables = {"dwells": lot.dwells, "history": lot.history, "fresh": lot.fresh, "fresh_history": lot.fresh_history}
    for file, table in tables.items():
        if table is not None:
            table.to_csv(target / f"{file}.csv", index=False)
    (target / "truth.json").write_text(json.dumps(lot.truth, indent=2) + "\n")


main()
