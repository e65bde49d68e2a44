"""The page of discoveries in the workbench, its figures and its table."""

from pathlib import Path

import pandas as pd
import pytest
from asgi_client import AsgiClient

from pipelines.archive import Archive
from pipelines.demo.archive_lots import Hidden, Line, write_lots
from pipelines.discovery.attributes import add_attributes
from pipelines.workbench.application import create_app
from pipelines.workbench.services import requests
from pipelines.workbench.services.jobs import Jobs
from pipelines.workbench.services.work import done_in_process
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import DiscoverPage


def test_a_discovery_is_on_the_page_with_its_levels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = write_lots(tmp_path, Line(9, hidden=Hidden("W02", -60e-6), wafers=4), 44)
    add_attributes(Archive(str(made.folder)), pd.read_csv(made.units, dtype=str), "serial", "units.csv")
    settings = WorkbenchSettings(archive=str(made.folder), folder=tmp_path / "bench", token="Zq8vXy3nR5tB7wK1mP4sD9")
    client = AsgiClient(create_app(settings), "http://127.0.0.1:8321")
    assert client.get("/discover").status_code == 200  # before it was asked for
    _, content = requests.discover(settings, DiscoverPage())
    end, found = done_in_process("discover", content, lambda *_: None)
    assert end == "done", found
    monkeypatch.setattr(Jobs, "result", lambda *_: found)
    page = client.get("/discover")
    assert page.status_code == 200
    assert "third_order" in page.text
    assert "differs by wafer" in page.text
    for name in ("levels-D1", "grown-D1", "strongest", "reach"):
        assert client.get(f"/discover/figure/{name}.json").status_code == 200, name
    assert client.get("/discover/figure/nothing.json").status_code == 422
    rows = client.get("/discover/levels-D1.csv").text.splitlines()
    assert rows[0].startswith("level,size_ug")
    assert rows[1].startswith("W02,")
    assert client.get("/discover/levels-D7.csv").status_code == 422
