"""A start of the orchestrator writes nothing into the installed packages."""

import sysconfig
from pathlib import Path

import pytest
from orchestrator import served

PACKAGES = Path(sysconfig.get_path("purelib"))


def listing() -> dict[str, tuple[int, int]]:
    """Size and time of the last change of every installed file, by its path."""
    return {
        str(path.relative_to(PACKAGES)): (status.st_size, status.st_mtime_ns)
        for path in PACKAGES.rglob("*")
        if path.is_file() and path.suffix != ".pyc"  # the interpreter's own, also of modules that other tests import
        for status in (path.stat(),)
    }


@pytest.mark.slow
def test_the_pages_of_the_server_are_copied_into_the_state_folder_and_nothing_into_the_packages(tmp_path: Path) -> None:
    before = listing()
    with served(tmp_path / "orchestrator", TUMBLELINE_STATE=str(tmp_path / "state")) as server:
        status, page = server.ask("/")
    assert status == 200
    assert "<html" in page.lower()
    assert {path.parent.name for path in (tmp_path / "state").rglob("index.html")} == {"v1", "v2"}
    after = listing()
    assert {path for path in before.keys() | after.keys() if before.get(path) != after.get(path)} == set()
