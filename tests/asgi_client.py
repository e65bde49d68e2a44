"""A client of an ASGI application in this process: every request in an event loop of its own, cookies kept between them."""

import asyncio
from typing import Any

import httpx


class AsgiClient:
    """Requests to an application, without a server."""

    def __init__(self, app: Any, base_url: str, *, follow_redirects: bool = False) -> None:
        self.app, self.base_url, self.follow, self.cookies = app, base_url, follow_redirects, httpx.Cookies()

    def request(self, method: str, address: str, **more: Any) -> httpx.Response:
        async def asked() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, raise_app_exceptions=False)
            async with httpx.AsyncClient(
                transport=transport, base_url=self.base_url, cookies=self.cookies, follow_redirects=self.follow
            ) as client:
                answer = await client.request(method, address, **more)
                self.cookies = client.cookies
                return answer

        return asyncio.run(asked())

    def get(self, address: str, **more: Any) -> httpx.Response:
        return self.request("GET", address, **more)

    def post(self, address: str, **more: Any) -> httpx.Response:
        return self.request("POST", address, **more)
