"""The page of measured figures: every row has its command, and `make bench` runs every benchmark that it names."""

import re

from benchmarks.__main__ import PAGE, SHORT, call, published


def test_every_benchmark_of_the_page_has_a_short_form_and_a_file() -> None:
    files = {name: call(name)[-1].removeprefix("benchmarks.") for name in published()}
    wrong = [name for name, path in files.items() if path != name and not (PAGE.parents[2] / path).exists()]
    assert wrong == []
    assert set(published()) == set(SHORT)


def test_every_row_has_a_figure_a_value_and_a_command_of_its_own_or_of_the_row_above() -> None:
    wrong = []
    for line in re.findall(r"^\|(?!---| figure \|).*$", PAGE.read_text(encoding="utf-8"), re.MULTILINE):
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) != 4 or not cells[0] or not cells[1] or not ("`" in cells[3] or cells[3].startswith("the same")):
            wrong.append(line)
    assert wrong == []
