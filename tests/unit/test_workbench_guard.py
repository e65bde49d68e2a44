"""Who may ask the workbench, and who may change something; nothing that is named becomes markup."""

import gzip
import hashlib
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from pkgutil import iter_modules

import httpx
import pytest
from asgi_client import AsgiClient
from capture_double import small_run

from pipelines.workbench import routes
from pipelines.workbench.application import create_app
from pipelines.workbench.routes.static_files import PLOTLY, PLOTLY_SHA256
from pipelines.workbench.settings import WorkbenchSettings
from schemas.errors import WrongUse

TOKEN = "a-token-of-a-test"
ORIGIN = "http://127.0.0.1:8321"
SCRIPT = "<img src=x onerror=alert(1)><script>alert(2)</script>"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("guard")
    small_run(folder)
    return folder / "archive"


@pytest.fixture
def settings(archive: Path, tmp_path: Path) -> WorkbenchSettings:
    return WorkbenchSettings(archive=str(archive), folder=tmp_path / "bench", token=TOKEN)


@pytest.fixture
def client(settings: WorkbenchSettings) -> AsgiClient:
    return AsgiClient(create_app(settings), ORIGIN)


def change(client: AsgiClient, **headers: str) -> httpx.Response:
    return client.post("/operator/nothing/stop", headers=headers)


@pytest.mark.parametrize("host", ["tumbleline.example", "127.0.0.1.example", "", "localhost.evil", "[::2]"])
def test_refuses_a_host_name_that_is_not_its_own(client: AsgiClient, host: str) -> None:
    assert client.get("/units", headers={"host": host}).status_code == 403


@pytest.mark.parametrize("host", ["127.0.0.1:8321", "localhost:8321", "[::1]:8321"])
def test_answers_to_the_names_of_this_machine(client: AsgiClient, host: str) -> None:
    assert client.get("/upload", headers={"host": host}).status_code == 200


def test_a_change_needs_its_own_origin_and_the_token(client: AsgiClient) -> None:
    known = {"authorization": f"Bearer {TOKEN}"}
    assert change(client).status_code == 403
    assert change(client, origin=ORIGIN).status_code == 403
    assert change(client, origin="http://evil.example", **known).status_code == 403
    assert change(client, origin="null", **known).status_code == 403
    assert change(client, authorization="Bearer another").status_code == 403
    assert change(client, origin=ORIGIN, **known).status_code == 422  # let through: there is no such lot
    assert change(client, **known).status_code == 422


def test_every_change_is_guarded(client: AsgiClient) -> None:
    modules = [import_module(f"{routes.__name__}.{info.name}") for info in iter_modules(routes.__path__)]
    changing = [route for module in modules for route in module.router.routes if route.methods - {"GET", "HEAD"}]
    assert len(changing) >= 7
    for route in changing:
        (method,) = route.methods
        address = route.path.replace("{name}", "x")
        foreign = {"origin": "http://evil.example", "authorization": f"Bearer {TOKEN}"}
        assert client.request(method, address, headers=foreign).status_code == 403, route.path
        assert client.request(method, address, headers={"origin": ORIGIN}).status_code == 403, route.path
        assert client.get(address).status_code in {404, 405, 422}, route.path


def test_the_token_of_the_address_becomes_a_cookie_that_no_script_reads(client: AsgiClient) -> None:
    answer = client.get(f"/missing?source=x&token={TOKEN}")
    assert answer.status_code == 303
    assert answer.headers["location"] == "/missing?source=x"
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert client.get("/missing?token=wrong").status_code == 403
    assert change(client, origin=ORIGIN).status_code == 422  # the client keeps the cookie


def test_from_another_machine_nothing_is_read_without_the_token(archive: Path, tmp_path: Path) -> None:
    far = WorkbenchSettings(
        archive=str(archive), folder=tmp_path, host="0.0.0.0", names=("bench.example",), token=TOKEN, proxied=True
    )
    client = AsgiClient(create_app(far), "https://bench.example")
    assert client.get("/units").status_code == 403
    assert client.get(f"/units?token={TOKEN}").status_code == 303
    assert client.get("/units").status_code == 200
    with pytest.raises(WrongUse, match="encryption"):
        create_app(WorkbenchSettings(archive=str(archive), folder=tmp_path, host="0.0.0.0"))


def test_pages_carry_a_policy_that_runs_no_script_but_our_files(client: AsgiClient) -> None:
    answer = client.get("/units")
    assert "script-src 'self';" in answer.headers["content-security-policy"]
    assert "unsafe-eval" not in answer.headers["content-security-policy"]
    assert TOKEN not in answer.text
    assert "<script>" not in answer.text
    assert " on" + "click" not in answer.text


@pytest.mark.parametrize(
    "address",
    [
        "/units?search={}",
        "/unit?run=latest&unit={}",
        "/missing?source={}",
        "/upload?file={}",
        "/plan?recipe={}",
        "/run?run={}",
    ],
)
def test_what_an_address_says_never_becomes_markup(client: AsgiClient, address: str) -> None:
    answer = client.get(address.format(httpx.QueryParams({"q": SCRIPT})["q"]), headers={"accept": "text/html"})
    assert answer.status_code in {200, 422}
    assert "<img src=x" not in answer.text
    assert "<script>alert" not in answer.text


@pytest.mark.parametrize("text", ["' OR 1=1 --", "%", "_", "!", "'; DROP TABLE units; --", "x' UNION SELECT 1 --"])
def test_what_is_searched_for_is_a_text_and_no_sql(client: AsgiClient, text: str) -> None:
    answer = client.get("/units", params={"search": text})
    assert answer.status_code == 200
    assert "No calibration matches" in answer.text


@pytest.mark.parametrize(
    "address",
    [
        "/units?page=0&outcome=maybe&since=yesterday",
        "/units?page=9e9",
        "/missing?colour=red&source=latest",
        "/audit?since=2026-1-1",
    ],
)
def test_what_an_address_says_wrongly_is_said_on_the_page(client: AsgiClient, address: str) -> None:
    answer = client.get(address)
    assert answer.status_code == 200
    assert "cannot be used" in answer.text


@pytest.mark.parametrize("source", ["/etc/passwd", "../archive/archive.json", "no-such-run", "a\0b"])
def test_no_other_file_of_the_machine_is_offered(client: AsgiClient, source: str) -> None:
    answer = client.get("/missing", params={"source": source})
    assert answer.status_code == 200
    assert 'role="alert"' in answer.text
    assert client.get("/upload", params={"file": source}).status_code == 200


def test_the_drawing_library_is_the_one_that_was_checked(client: AsgiClient) -> None:
    packed = (files("pipelines.workbench") / "static" / "vendor" / f"{PLOTLY}.gz").read_bytes()
    assert hashlib.sha256(gzip.decompress(packed)).hexdigest() == PLOTLY_SHA256
    assert b"plotly.js (strict - minified) v4.1.1" in gzip.decompress(packed)[:200]
    assert (
        "Permission is hereby granted"
        in (files("pipelines.workbench") / "static" / "vendor" / "plotly-LICENSE.txt").read_text()
    )
    answer = client.get(f"/static/x/{PLOTLY}", headers={"accept-encoding": "gzip"})
    assert "immutable" in answer.headers["cache-control"]
    assert hashlib.sha256(answer.content).hexdigest() == PLOTLY_SHA256
    assert client.get("/static/x/../../pages.py").status_code == 404


def test_an_empty_archive_has_every_page(tmp_path: Path) -> None:
    settings = WorkbenchSettings(archive=str(tmp_path / "none"), folder=tmp_path / "bench", token=TOKEN)
    client = AsgiClient(create_app(settings), ORIGIN)
    for address in ("/units", "/missing", "/upload", "/operator", "/plan", "/station", "/audit"):
        assert client.get(address).status_code == 200, address
    assert not (tmp_path / "none").exists()
    assert client.get("/run?run=latest").status_code == 422
    assert client.get("/nowhere").status_code == 404
