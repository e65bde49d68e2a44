"""The workbench on an archive with many units, broken runs and scripts in every name; in a browser: tests/e2e."""

import re
from pathlib import Path

import pytest
from asgi_client import AsgiClient
from unusual_archives import MANY, addresses, unusual_archive

from pipelines.workbench.application import create_app
from pipelines.workbench.settings import WorkbenchSettings


@pytest.fixture(scope="module")
def top(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unusual")
    unusual_archive(folder / "archive")
    return folder


@pytest.fixture
def client(top: Path) -> AsgiClient:
    settings = WorkbenchSettings(archive=str(top / "archive"), folder=top / "bench", token="Zq8vXy3nR5tB7wK1mP4sD9")
    return AsgiClient(create_app(settings), "http://127.0.0.1:8321")


def page(client: AsgiClient, address: str) -> str:
    """A page, which may be one that says what is wrong and is no defect."""
    answer = client.get(address, headers={"accept": "text/html"})
    assert answer.status_code in {200, 422}, (address, answer.text[:2000])
    assert "defect of the program" not in answer.text, address
    return answer.text


@pytest.mark.slow
def test_five_hundred_units_are_found_and_paged(top: Path, client: AsgiClient) -> None:
    assert "51 to 100 of" in page(client, "/units?search=MANY0&outcome=pass&page=2")
    assert re.search(r'href="/units\?[^"]*page=2[^"]*"[^>]*>\s*Next', page(client, "/units?search=MANY0&outcome=pass"))
    run = next(path.name for path in top.glob("archive/runs/bench-*"))
    assert run[:20] in page(
        client, f"/units?search={run[:20].upper()}&outcome=refused"
    )  # a run without such units, too
    text = page(client, f"/run?run={run}")
    assert [one for one in MANY if one not in text] == []


def test_a_broken_run_is_said_in_a_sentence_and_the_others_are_shown(client: AsgiClient) -> None:
    for number in (2, 3, 4):
        for path in ("/run?run=", "/unit?run=", "/station?run=", "/missing?source="):
            page(client, f"{path}broken-{number}")
    assert "1 to 50 of" in page(client, "/units")


def test_a_script_in_a_name_is_text(top: Path, client: AsgiClient) -> None:
    run = next(path.name for path in top.glob("archive/runs/named-*"))
    for address in (*addresses(run), "/units"):
        text = page(client, address)
        assert "<img src=x" not in text, address
        assert "<script>window" not in text, address
    assert "&lt;img src=x" in page(client, f"/run?run={run}")
