"""The page of an audit in the workbench, and its tables."""

from pathlib import Path

import pytest
from asgi_client import AsgiClient

from benchmarks.generated_archive import write_archive
from pipelines.workbench.application import create_app
from pipelines.workbench.services import requests
from pipelines.workbench.services.jobs import Jobs
from pipelines.workbench.services.work import done_in_process
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import AuditPage


def test_a_figure_of_too_few_lots_for_a_cpk_is_on_the_page_and_in_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_archive(tmp_path / "archive", 6, years=2.0, seed=3, workers=1)
    settings = WorkbenchSettings(
        archive=str(tmp_path / "archive"), folder=tmp_path / "bench", token="Zq8vXy3nR5tB7wK1mP4sD9"
    )
    _, content = requests.audit(settings, AuditPage())
    end, audited = done_in_process("audit", content, lambda *_: None)
    assert end == "done", audited
    capability = audited["document"]["population"]["capability"]
    figure, others = capability[0], capability[1:]
    assert others
    figure["cpk"] = None
    monkeypatch.setattr(Jobs, "result", lambda *_: audited)
    client = AsgiClient(create_app(settings), "http://127.0.0.1:8321")
    assert figure["figure"] in client.get("/audit/capability.csv").text
    heads = client.get("/audit/capability.csv").text.splitlines()[0].split(",")
    assert {"ppk_low", "cpk_low"} <= set(heads)
    page = client.get("/audit")
    assert page.status_code == 200
    assert "Capability" in page.text
    assert client.get("/audit/nothing.csv").status_code == 404
