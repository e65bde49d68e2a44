"""Pages that are written from the code are those of the code of today, and the architecture names what exists."""

import re
from importlib import import_module

from each import each
from root_process import ROOT

from docs import architecture_page
from docs.architecture_page import PAGE, PICTURE, STOPS, contracts, missing, picture, rows

OTHERS = {"architecture_page", "generated_page"}
MODULES = sorted(path.stem for path in (ROOT / "docs").glob("*_page.py") if path.stem not in OTHERS)


@each(MODULES)
def test_a_generated_page_is_up_to_date(name: str) -> None:
    module = import_module(f"docs.{name}")
    text = module.PAGE.read_text(encoding="utf-8")
    own = module.page(text) if name == "documents_page" else module.page()
    assert text == own, f"write it again with 'python -m docs.{name}'"


def test_the_page_of_the_architecture_is_up_to_date_but_for_its_numbers_of_lines() -> None:
    text, own, again = PAGE.read_text(encoding="utf-8"), architecture_page.page(), "python -m docs.architecture_page"
    assert text.startswith(own.partition("## The largest rooms")[0]), f"write it again with '{again}'"
    assert own.partition("## Words")[2] == text.partition("## Words")[2]
    assert PICTURE.read_text(encoding="utf-8") == picture(), f"write it again with '{again}'"


def test_every_stop_every_room_and_every_module_that_the_guides_of_the_code_name_is_there() -> None:
    assert missing() == []
    assert len(STOPS) == 12
    drawn = {path for _, row in rows() for _, path in row}
    assert {f"{package}/{room}" for package, layers in contracts().items() for row in layers for room in row} <= drawn
    named = re.compile(r"`((?:inertial|pipelines|stations|schemas|tests|deploy|docs)/[\w./-]*)`")
    guides = [ROOT / "CONTRIBUTING.md", PAGE.parent / "how-a-diagnosis-works.md"]
    assert [
        name for guide in guides for name in named.findall(guide.read_text("utf-8")) if not (ROOT / name).exists()
    ] == []


def test_the_words_of_the_product_are_few_and_linked_from_where_a_reader_begins() -> None:
    words = [word for word, _ in architecture_page.GLOSSARY]
    assert len(words) == len(set(words)) <= 25
    link = re.compile(r"\[([\w ]+)\]\([\w/.]*explanation/architecture\.md#words\)")
    for page in [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorial").glob("*.md"))]:
        linked = link.findall(page.read_text(encoding="utf-8"))
        assert linked, f"{page.name} links no word of the glossary"
        known = {word for word in linked if re.sub(r"(ss)es$|s$", r"\1", word) in words or word in words}
        assert set(linked) == known, page.name
