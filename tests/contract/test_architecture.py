"""The page of the architecture is that of the layer contracts, and every stop of its tour exists."""

import re

from docs.architecture_page import PAGE, PICTURE, STOPS, contracts, missing, page, picture, rows


def test_every_stop_of_the_tour_is_a_file_with_that_function() -> None:
    assert missing() == []
    assert len(STOPS) == 12


def test_the_picture_has_every_room_of_the_contracts_and_is_up_to_date() -> None:
    drawn = {path for _, row in rows() for _, path in row}
    assert {f"{package}/{room}" for package, layers in contracts().items() for row in layers for room in row} <= drawn
    assert PICTURE.read_text(encoding="utf-8") == picture(), "write it again with 'python -m docs.architecture_page'"


def test_the_page_is_up_to_date_but_for_its_numbers_of_lines() -> None:
    head = page().partition("## The largest rooms")[0]
    assert PAGE.read_text(encoding="utf-8").startswith(head), "write it again with 'python -m docs.architecture_page'"
    assert page().partition("## Words")[2] == PAGE.read_text(encoding="utf-8").partition("## Words")[2]


def test_every_module_that_the_guides_of_the_code_name_is_there() -> None:
    root = PAGE.parents[2]
    named = re.compile(r"`((?:inertial|pipelines|stations|schemas|tests|deploy|docs)/[\w./-]*)`")
    guides = [root / "CONTRIBUTING.md", PAGE.parent / "how-a-diagnosis-works.md"]
    wrong = [name for guide in guides for name in named.findall(guide.read_text("utf-8")) if not (root / name).exists()]
    assert wrong == []
