"""Who may ask the workbench, and who may change something; nothing that is named becomes markup."""

import asyncio
import gzip
import hashlib
import json
import re
from dataclasses import replace
from importlib import import_module
from importlib.resources import files
from itertools import product
from pathlib import Path
from pkgutil import iter_modules
from typing import Any
from urllib.parse import quote, unquote

import httpx
import pytest
from asgi_client import AsgiClient
from each import each

from pipelines.archive import Run
from pipelines.workbench import routes
from pipelines.workbench.application import create_app
from pipelines.workbench.routes.static_files import PLOTLY, PLOTLY_SHA256
from pipelines.workbench.security import PROOF
from pipelines.workbench.settings import WorkbenchSettings
from schemas.errors import WrongUse

TOKEN = "Zq8vXy3nR5tB7wK1mP4sD9"
ORIGIN = "http://127.0.0.1:8321"
TO_DO = "reload the page|correct it"
SCRIPT = "<img src=x onerror=alert(1)><script>alert(2)</script>"


@pytest.fixture
def settings(run: Run, tmp_path: Path) -> WorkbenchSettings:
    return WorkbenchSettings(archive=str(run.archive.root), folder=tmp_path / "bench", token=TOKEN)


@pytest.fixture
def client(settings: WorkbenchSettings) -> AsgiClient:
    return AsgiClient(create_app(settings), ORIGIN)


def change(client: AsgiClient, **headers: str) -> httpx.Response:
    return client.post("/operator/nothing/stop", headers=headers)


def test_answers_to_the_names_of_this_machine_alone(client: AsgiClient) -> None:
    for status, hosts in (
        (403, ("tumbleline.example", "127.0.0.1.example", "", "localhost.evil", "[::2]")),
        (200, ("127.0.0.1:8321", "localhost:8321", "[::1]:8321")),
    ):
        for host in hosts:
            assert client.get("/upload", headers={"host": host}).status_code == status, host


def test_every_change_needs_its_own_origin_and_the_token(client: AsgiClient) -> None:
    known = {"authorization": f"Bearer {TOKEN}"}
    for foreign in ({}, {"origin": ORIGIN}, {"origin": "http://evil.example", **known}, {"origin": "null", **known}):
        assert change(client, **foreign).status_code == 403, foreign
    assert change(client, authorization="Bearer another").status_code == 403
    assert change(client, origin=ORIGIN, **known).status_code == 422  # let through: there is no such lot
    assert change(client, **known).status_code == 422
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


def enter(client: AsgiClient, address: str = "/units") -> tuple[str, str]:
    """The session's cookie and the proof for changes, as a browser gets them."""
    answer = client.get(f"{address}?token={TOKEN}")
    assert answer.status_code == 303
    cookie = answer.headers["set-cookie"].partition(";")[0].partition("=")[2]
    return cookie, answer.headers["location"].rpartition("#change=")[2]


def test_the_token_of_the_address_becomes_a_session_that_no_script_reads(client: AsgiClient) -> None:
    answer = client.get(f"/missing?source=x&token={TOKEN}")
    address, _, proof = answer.headers["location"].partition("#change=")
    assert (answer.status_code, address) == (303, "/missing?source=x")
    assert TOKEN not in str(answer.headers)
    assert {"httponly", "samesite=strict"} <= {*re.split("; ?", answer.headers["set-cookie"].lower())}
    assert client.get("/missing?token=wrong").status_code == 403
    assert change(client, origin=ORIGIN, **{PROOF: proof}).status_code == 422  # the client keeps the cookie


def test_the_cookie_that_other_ports_get_changes_nothing_and_is_no_bearer(client: AsgiClient) -> None:
    cookie, proof = enter(client)
    assert change(client, origin=ORIGIN).status_code == 403
    assert change(client, origin=ORIGIN, **{PROOF: "0" * 64}).status_code == 403
    for secret in (cookie, proof):
        assert change(client, authorization=f"Bearer {secret}").status_code == 403
        assert client.get(f"/units?token={secret}").status_code == 403
    assert enter(client) != (cookie, proof)
    assert change(client, origin=ORIGIN, **{PROOF: proof}).status_code == 403  # that of another session


def test_a_session_is_of_one_origin_and_ends(
    client: AsgiClient, settings: WorkbenchSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    cookie, proof = enter(client)
    own = {"origin": ORIGIN, "cookie": f"{settings.cookie}={cookie}", PROOF: proof}

    def told(service: WorkbenchSettings, host: str) -> int:
        sent = own | {"origin": f"http://{host}", "cookie": f"{service.cookie}={cookie}"}
        return change(AsgiClient(create_app(service), f"http://{host}"), **sent).status_code

    assert told(settings, "127.0.0.1:8321") == 422
    assert told(settings, "localhost:8321") == 403
    assert told(settings, "127.0.0.1:8322") == 403
    assert told(replace(settings, port=8322), "127.0.0.1:8322") == 403
    assert told(replace(settings, token=TOKEN[::-1]), "127.0.0.1:8321") == 403
    end, rest = cookie.partition(".")[::2]
    forged = f"{int(end) + 1}.{rest}"
    assert change(client, **own | {"cookie": f"{settings.cookie}={forged}"}).status_code == 403
    monkeypatch.setattr("pipelines.workbench.security.time.time", lambda: float(end))
    assert told(settings, "127.0.0.1:8321") == 403


def test_a_token_that_can_be_guessed_is_refused_and_those_that_are_made_are_long(settings: WorkbenchSettings) -> None:
    for token, said in (
        ("", "0 bits"), ("secret", "a token of 6 characters"), ("0123456789abcdef012345678", "100 bits"),
        ("1" * 40, "1 different characters"), ("Zq8vXy3nR5tB7wK1mP4s", "121 bits"),
        ("Zq8vXy3nR5tB7wK1mP4sD9 &x=", "characters other than"),
    ):  # fmt: skip
        with pytest.raises(WrongUse, match=f"{said}.*at least 128 bits"):
            create_app(replace(settings, token=token))
    replace(settings, token="0123456789abcdef" * 2 + "g").refuse_unsafe()
    for _ in range(200):
        WorkbenchSettings(archive="x", folder=settings.folder).refuse_unsafe()


@each([
    "forwarded", "via", "x-forwarded-for", "x-forwarded-proto", "x-forwarded-host", "x-forwarded-port", "x-forwarded-server",
    "x-real-ip", "x-original-forwarded-for", "x-client-ip", "true-client-ip", "cf-connecting-ip",
])  # fmt: skip
def test_what_a_proxy_of_this_machine_passes_on_is_not_local(header: str, client: AsgiClient) -> None:
    assert client.get("/units").status_code == 200
    assert client.get("/units", headers={header: "127.0.0.1"}).status_code == 403
    assert client.get("/units", headers={header: ""}).status_code == 403
    assert client.get("/units", headers={header: "x", "authorization": f"Bearer {TOKEN}"}).status_code == 200


def test_behind_a_proxy_or_by_another_name_nothing_is_local(settings: WorkbenchSettings) -> None:
    named = AsgiClient(create_app(replace(settings, names=("bench.example",))), ORIGIN)
    assert named.get("/units", headers={"host": "bench.example"}).status_code == 403
    assert named.get("/units").status_code == 200
    proxied = AsgiClient(create_app(replace(settings, proxied=True)), ORIGIN)
    assert proxied.get("/units").status_code == 403
    assert "through a proxy the token is needed" in proxied.get("/units").text
    assert raw(settings, "/upload").status_code == 200
    assert raw(settings, "/upload", http="1.0").status_code == 403  # a proxy that shows itself by its protocol alone


@each(["//evil.example", "//evil.example/%2e%2e", "/%5Cevil.example", "/\\evil.example", "/%2Fevil.example",
       "http://evil.example/", "/%09/evil.example", "/%0d%0aset-cookie:x", "/units%00"])  # fmt: skip
def test_no_address_leads_to_another_host(path: str, settings: WorkbenchSettings) -> None:
    answer = raw(settings, path, f"token={TOKEN}")
    assert answer.status_code == 400
    assert "location" not in answer.headers
    assert "correct it" in answer.text


def raw(settings: WorkbenchSettings, path: str, query: str = "", http: str = "1.1") -> httpx.Response:
    """The answer to a path as it is written: clients normalise it."""
    sent: list[Any] = []
    scope = {
        "type": "http", "method": "GET", "path": unquote(path), "raw_path": path.encode(), "query_string": query.encode(),
        "headers": [(b"host", b"127.0.0.1:8321")], "http_version": http, "scheme": "http", "server": ("127.0.0.1", 8321),
        "client": ("127.0.0.1", 50000), "root_path": "",
    }  # fmt: skip

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        sent.append(message)

    async def asked() -> None:
        await create_app(settings)(scope, receive, send)

    asyncio.run(asked())
    body = b"".join(one.get("body", b"") for one in sent[1:])
    return httpx.Response(sent[0]["status"], headers=sent[0]["headers"], content=body)


def test_from_another_machine_nothing_is_read_without_the_token(settings: WorkbenchSettings) -> None:
    far = replace(settings, host="0.0.0.0", names=("bench.example",), proxied=True)
    client = AsgiClient(create_app(far), "https://bench.example")
    for address, status in (("/units", 403), (f"/units?token={TOKEN}", 303), ("/units", 200)):
        assert client.get(address).status_code == status, address
    with pytest.raises(WrongUse, match="encryption"):
        create_app(replace(settings, host="0.0.0.0"))


def test_pages_carry_a_policy_that_runs_no_script_but_our_files(client: AsgiClient) -> None:
    answer = client.get("/units")
    policy = answer.headers["content-security-policy"]
    assert ("script-src 'self';" in policy, "unsafe-eval" in policy) == (True, False)
    assert [text for text in (TOKEN, "<script>", " on" + "click") if text in answer.text] == []


ADDRESSES: list[tuple[str, set[int], str]] = [  # address, statuses, and what stands on the page
    *((f"/units?search={quote(text)}", {200}, "No calibration matches")
      for text in ("' OR 1=1 --", "%", "_", "!", "'; DROP TABLE units; --", "x' UNION SELECT 1 --")),
    *((address, {200}, "cannot be used") for address in (
        "/units?page=0&outcome=maybe&since=yesterday", "/units?page=9e9", "/missing?colour=red&source=latest",
        "/audit?since=2026-1-1")),
    *((f"/missing?source={quote(file)}", {200}, 'role="alert"')
      for file in ("/etc/passwd", "../archive/archive.json", "no-such-run", "a\0b")),
    *((f"/upload?file={quote(file)}", {200}, "") for file in ("/etc/passwd", "../archive/archive.json", "a\0b")),
    *((address + quote(SCRIPT), {200, 422}, "") for address in (
        "/units?search=", "/unit?run=latest&unit=", "/missing?source=", "/upload?file=", "/plan?recipe=", "/run?run=")),
    *((address, {400}, "correct it") for address in (
        "/run/table/a%00b.csv?run=latest", "/unit/figure/a%00b.png", "/jobs/a%00b", "/static/a%00/b%00.js")),
    *((address, {200, 404, 422}, "") for address in (
        "/units?search=a%00b", "/run?run=a%00b", "/unit?run=latest&unit=a%00b", "/a?a%00b=1",
        "/run/table/units.csv?run=a%00b", "/station?run=a%00", "/models?model=a%00b")),
]  # fmt: skip


@each(ADDRESSES, ascii)
def test_what_an_address_says_is_text_and_never_markup_sql_a_file_or_a_defect(
    row: tuple[str, set[int], str], client: AsgiClient
) -> None:
    address, statuses, said = row
    answer = client.get(address, headers={"accept": "text/html"})
    assert answer.status_code in statuses
    assert said in answer.text
    for word in ("<img src=x", "<script>alert", "defect"):
        assert word not in answer.text


def test_the_drawing_library_is_the_one_that_was_checked(client: AsgiClient) -> None:
    packed = (files("pipelines.workbench") / "static" / "vendor" / f"{PLOTLY}.gz").read_bytes()
    assert hashlib.sha256(gzip.decompress(packed)).hexdigest() == PLOTLY_SHA256
    answer = client.get(f"/static/x/{PLOTLY}", headers={"accept-encoding": "gzip"})
    assert "immutable" in answer.headers["cache-control"]
    assert hashlib.sha256(answer.content).hexdigest() == PLOTLY_SHA256
    assert client.get("/static/x/../../pages.py").status_code == 404


@each(product(["residuals", "allan", "history", "samples"], ["png", "json", "csv"]), ".".join)
def test_a_figure_of_a_unit_without_data_is_a_sentence(figure: tuple[str, str], client: AsgiClient) -> None:
    answer = client.get(f"/unit/figure/{'.'.join(figure)}?run=latest&unit=NOBODY&dwell=NOBODY:1&parameter=x")
    assert answer.status_code == 422
    assert re.search("; (choose|click) ", answer.json()["problem"])


SLOTS = ("slot-x", "slot-", "slot-²", "slot-8", "slot--1", "slot-01", "slot-99999", "slot-" + "9" * 5000)
REFUSED_BODIES: list[tuple[str, object, str]] = [
    *(("/operator/start", {"recipe": "production", key: "A1"}, "a slot from 0 to 7 of the station") for key in SLOTS),
    ("/operator/start", {"recipe": "production", "slot-1": "A\0"}, TO_DO),
    ("/operator/start", {"recipe": "\ud800"}, TO_DO),
    ("/jobs", {"kind": "\ud800"}, TO_DO),
    ("/jobs", {"kind": "diagnose", "address": "http://[x"}, TO_DO),
    ("/plan/pose", {"address": "http://[x"}, TO_DO),
    ("/plan/save", {"name": "a\0b"}, TO_DO),
    ("/jobs", ["kind"], TO_DO),
]


@each(REFUSED_BODIES, ascii)
def test_a_body_that_cannot_be_used_is_a_sentence(case: tuple[str, object, str], client: AsgiClient) -> None:
    address, body, said = case
    headers = {"authorization": f"Bearer {TOKEN}", "content-type": "application/json"}
    answer = client.post(address, headers=headers, content=json.dumps(body))
    assert answer.status_code == 422
    assert re.search(said, answer.json()["problem"])


def test_an_empty_archive_has_every_page_with_what_to_do(tmp_path: Path) -> None:
    settings = WorkbenchSettings(archive=str(tmp_path / "none"), folder=tmp_path / "bench", token=TOKEN)
    client = AsgiClient(create_app(settings), ORIGIN)
    pages = {
        "/units": "Measure a lot", "/missing": "Choose a source", "/models": "No model file yet", "/upload": "Drop a file",
        "/operator": "Scan each unit", "/plan": "", "/station": "Measure a lot", "/audit": "Measure a lot",
    }  # fmt: skip
    for address, words in pages.items():
        answer = client.get(address)
        assert (answer.status_code, words in answer.text) == (200, True), address
    assert not (tmp_path / "none").exists()
    assert client.get("/run?run=latest").status_code == 422
    assert client.get("/nowhere").status_code == 404
