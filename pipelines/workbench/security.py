"""Access control for reading and changes: an ASGI application around all requests, including event streams.

Reading needs a known host name, so that no foreign page reaches the service by its own name (DNS rebinding). Without the
token only this machine reads: a request to a loopback name that shows no sign of a proxy, because a proxy on this machine
passes on requests of everybody. A change also needs the same origin and the token.

Browsers send a cookie to every port of a host, so the server of another port gets it. It is therefore not the token: it is a
session that only one origin accepts, and only for reading. The proof for changes is kept in the storage of the page, which
belongs to one origin with its port, and is never sent to another.
"""

import hashlib
import hmac
import secrets
import time
from contextlib import suppress
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from pipelines.workbench.settings import LOOPBACK_HOSTS, WorkbenchSettings

SESSION_S = 7 * 86400
READING = frozenset({"GET", "HEAD"})
CHANGING = frozenset({"POST", "PUT", "DELETE"})
PROOF = "x-change-proof"
"""Header of the changes of pages: the cookie, which other ports get too, is not enough."""
PROXIES = (
    "forwarded", "via", "x-forwarded", "x-real-ip", "x-client-ip", "x-cluster-client-ip", "x-original-", "x-envoy-",
    "true-client-ip", "cf-connecting-ip", "fastly-client-ip", "x-proxy", "proxy-",
)  # fmt: skip
"""Beginnings of headers that proxies add."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; worker-src 'self' blob:; font-src 'self'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'; manifest-src 'self'"
)
"""Only scripts of the product. Plotly writes inline styles, and makes PNG from data and blob addresses."""
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=()",
}


class Guard:
    """Passes permitted requests; every response has the headers above."""

    def __init__(self, app: ASGIApp, settings: WorkbenchSettings) -> None:
        self._app, self._settings = app, settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, refuse, or pass on a request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":  # no WebSockets
            await send({"type": "websocket.close", "code": 1008})
            return
        if _misspelt(scope["path"]):
            text = (
                "workbench: the address is no path, or has a control character, a backslash or two slashes at its beginning; "
                "correct it"
            )
            await PlainTextResponse(text, 400)(scope, receive, _with_headers(send))
            return
        refusal = _refused(scope, self._settings)
        answer = _entering(scope, self._settings) if refusal is None else PlainTextResponse(refusal, 403)
        if answer is not None:
            await answer(scope, receive, _with_headers(send))
            return
        scope["state"] = {**scope.get("state", {}), "may_change": _known(scope, self._settings)}
        await self._app(scope, receive, _with_headers(send))


def _misspelt(path: str) -> bool:
    """Whether no page has this path, and browsers would read it as another host or not at all."""
    return (
        not path.startswith("/")
        or path.startswith("//")
        or "\\" in path
        or any(letter < " " or letter == "\x7f" for letter in path)
    )


def _refused(scope: Scope, settings: WorkbenchSettings) -> str | None:
    """The reason for a refusal; None if the request is permitted."""
    headers = Headers(scope=scope)
    name = _host(headers)
    if name not in settings.hosts:
        return f"workbench: host '{name[:80]}' is not a name of this service; open {settings.address}"
    if scope["method"] in READING:
        return _refused_to_read(scope, headers, settings)
    if scope["method"] in CHANGING:
        return _refused_to_change(headers, settings)
    return f"workbench: method {scope['method'][:20]} is not supported"


def _host(headers: Headers) -> str:
    """The host name of a request, without its port; an IPv6 address keeps its brackets."""
    text = headers.get("host", "").lower()
    before, bracket, _ = text.rpartition("]")
    return before + bracket if bracket else text.partition(":")[0]


def _refused_to_read(scope: Scope, headers: Headers, settings: WorkbenchSettings) -> str | None:
    if headers.get("sec-fetch-site") == "cross-site" and headers.get("sec-fetch-mode") not in {None, "navigate"}:
        return "workbench: requests from other sites are refused"
    if not _local(scope, headers, settings) and not _known(scope, settings) and not _asks_to_enter(scope):
        return (
            "workbench: from another machine or through a proxy the token is needed; open the address that the command "
            "printed"
        )
    return None


def _local(scope: Scope, headers: Headers, settings: WorkbenchSettings) -> bool:
    """Whether the request came from this machine; by HTTP/1.0, which no browser uses, some proxies ask without a header."""
    return (
        settings.local
        and not settings.proxied
        and scope["http_version"] != "1.0"
        and _host(headers) in LOOPBACK_HOSTS
        and not any(name.startswith(PROXIES) for name in headers)
    )


def _refused_to_change(headers: Headers, settings: WorkbenchSettings) -> str | None:
    origin = headers.get("origin")
    if origin is None and not _bearer(headers):
        return "workbench: a change without an origin is refused; send the token as 'Authorization: Bearer …'"
    if origin is not None and origin not in _origins(headers, settings):
        return f"workbench: origin '{origin[:80]}' must not change data"
    if _bearer_given(headers, settings):
        return None
    value = _session(headers, settings)
    proof = change_proof(settings.token, _bound(headers, settings), value)
    if not value or not secrets.compare_digest(headers.get(PROOF, "").encode(), proof.encode()):
        return "workbench: this browser has read access only; open the address with the token that the command printed"
    return None


def _origins(headers: Headers, settings: WorkbenchSettings) -> set[str]:
    host = headers.get("host", "").lower()
    schemes = ("https",) if settings.tls else ("https", "http") if settings.proxied else ("http",)
    return {f"{scheme}://{host}" for scheme in schemes}


def _bearer(headers: Headers) -> str:
    kind, _, value = headers.get("authorization", "").partition(" ")
    return value.strip() if kind.lower() == "bearer" else ""


def _bearer_given(headers: Headers, settings: WorkbenchSettings) -> bool:
    return secrets.compare_digest(_bearer(headers).encode(), settings.token.encode())


def _bound(headers: Headers, settings: WorkbenchSettings) -> str:
    """The origin that a session belongs to, and the service behind it."""
    return f"{'https' if settings.secure else 'http'}://{headers.get('host', '').lower()} {settings.address}"


def _session(headers: Headers, settings: WorkbenchSettings) -> str:
    """The session of the cookie; empty where there is none that holds."""
    cookie: Any = None
    with suppress(CookieError):
        cookie = SimpleCookie(headers.get("cookie", "")).get(settings.cookie)
    value = "" if cookie is None else str(cookie.value)
    return value if session_holds(settings.token, _bound(headers, settings), value) else ""


def _known(scope: Scope, settings: WorkbenchSettings) -> bool:
    """Whether the request has the token or a session."""
    headers = Headers(scope=scope)
    return _bearer_given(headers, settings) or bool(_session(headers, settings))


def _asks_to_enter(scope: Scope) -> bool:
    return any(name == "token" for name, _ in parse_qsl(scope["query_string"].decode("latin-1")))


def _entering(scope: Scope, settings: WorkbenchSettings) -> RedirectResponse | PlainTextResponse | None:
    """The token of the address exchanged for a session, so that it does not remain in the address.

    The proof for changes is behind the address' #: browsers do not send this part, and the page stores it.
    """
    if scope["method"] not in READING or not _asks_to_enter(scope):
        return None
    query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
    token = next(value for name, value in query if name == "token")
    if not secrets.compare_digest(token.encode(), settings.token.encode()):
        return PlainTextResponse(
            "workbench: this is not the token of this service; use the address that it printed", 403
        )
    rest = urlencode([pair for pair in query if pair[0] != "token"])
    headers = Headers(scope=scope)
    bound = _bound(headers, settings)
    value = session(settings.token, bound)
    target = f"{quote(scope['path'])}{'?' + rest if rest else ''}#change={change_proof(settings.token, bound, value)}"
    answer = RedirectResponse(target, 303)
    answer.set_cookie(
        settings.cookie, value, max_age=SESSION_S, httponly=True, samesite="strict", secure=settings.secure, path="/"
    )
    return answer


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers[name] = value
            headers.setdefault("cache-control", "no-store")
        await send(message)

    return sending


def session(token: str, origin: str) -> str:
    """A new session of a browser for one origin: time of its end, a random number, and their code."""
    content = f"{int(time.time()) + SESSION_S}.{secrets.token_hex(16)}"
    return f"{content}.{_code(token, 'session', origin, content)}"


def session_holds(token: str, origin: str, value: str) -> bool:
    """Whether this service gave the session, for this origin, and it has not ended."""
    content, _, code = value.rpartition(".")
    end = content.partition(".")[0]
    return (
        hmac.compare_digest(code.encode(), _code(token, "session", origin, content).encode())
        and end.isdecimal()
        and time.time() < int(end)
    )


def change_proof(token: str, origin: str, value: str) -> str:
    """The token that the page of a session sends with its changes."""
    return _code(token, "change", origin, value)


def _code(token: str, *parts: str) -> str:
    return hmac.new(token.encode(), "\0".join(parts).encode(), hashlib.sha256).hexdigest()
