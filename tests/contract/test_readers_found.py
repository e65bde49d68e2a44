"""One reader of files is one file: found where it lies, and refused with all that is missing."""

from collections.abc import Callable
from pathlib import Path

import pytest

from pipelines.importers import readers
from pipelines.importers.readers import READERS, IncompleteReader, find_readers

ROOT = Path(__file__).resolve().parents[2]
READER = """
NAME, TITLE, EXTRA, ORDER = "{name}", "Format", "", {order}
def recognised(data): return True
def read(name, data, group): return None
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request) -> Callable[..., tuple[str, list[str]]]:
    """Makes a package of modules; gives its name and path."""

    def made(**modules: str) -> tuple[str, list[str]]:
        name = f"of_{abs(hash(request.node.nodeid))}"
        (tmp_path / name).mkdir()
        for module, text in {"__init__": "", **modules}.items():
            (tmp_path / name / f"{module}.py").write_text(text)
        monkeypatch.syspath_prepend(tmp_path)
        return name, [str(tmp_path / name)]

    return made


def named_elsewhere(folder: Path, names: list[str]) -> list[str]:
    """Files of the product outside a folder that import one of its modules by name."""
    dotted = ".".join(folder.relative_to(ROOT).parts)
    found: list[str] = []
    for room in ("inertial", "schemas", "stations", "pipelines"):
        for path in (ROOT / room).rglob("*.py"):
            text = "" if path.is_relative_to(folder) else path.read_text(encoding="utf-8")
            found += [f"{path.relative_to(ROOT)}: {name}" for name in names if f"{dotted}.{name} import" in text]
    return found


def test_a_reader_is_one_file(package) -> None:
    found = find_readers(*package(one=READER.format(name="one", order=20), two=READER.format(name="two", order=10)))
    assert list(found) == ["two", "one"]


def test_readers_that_are_half_there_are_refused_with_all_that_is_missing(package) -> None:
    half = "NAME, TITLE = 'half', 'Half'\ndef read(name, data, group): return None\n"
    whole, same = READER.format(name="one", order=20), READER.format(name="same", order=20)
    with pytest.raises(IncompleteReader, match=r"half: no EXTRA, ORDER, recognised; .*two: NAME 'same' or ORDER 20"):
        find_readers(*package(half=half, one=whole, two=same))


def test_no_other_file_names_a_reader() -> None:
    modules = [one.__name__.rpartition(".")[2] for one in READERS.values()]
    assert named_elsewhere(Path(readers.__file__).parent, modules) == []
