"""Scripts and styles, by addresses that change with their content; that of Plotly is compressed already."""

import gzip
from functools import cache
from importlib.resources import files

from fastapi import APIRouter, Request
from starlette.exceptions import HTTPException
from starlette.responses import Response

router = APIRouter()
KINDS = {"js": "text/javascript; charset=utf-8", "css": "text/css; charset=utf-8", "svg": "image/svg+xml"}
FOREVER = "public, max-age=31536000, immutable"
PLOTLY = "plotly-strict-4.1.1.min.js"
PAINT = "paint.js"  # shared with reports
PLOTLY_SHA256 = "4ac841837b31c1bfd2ab140e3a248ddcc6c2106978fbf2c1c18a7aada930a37a"


@router.get("/static/{version}/{name}")
def static(request: Request, version: str, name: str) -> Response:
    """A file of the product, or Plotly's bundle."""
    headers = {"cache-control": FOREVER}
    if name == PLOTLY:
        if "gzip" in request.headers.get("accept-encoding", ""):
            packed = {"content-encoding": "gzip", "vary": "accept-encoding"}
            return Response(_bundle(), media_type=KINDS["js"], headers=headers | packed)
        return Response(gzip.decompress(_bundle()), media_type=KINDS["js"], headers=headers)
    content = _file(name)
    if content is None:
        raise HTTPException(404)
    return Response(content, media_type=KINDS[name.rpartition(".")[2]], headers=headers)


@router.get("/favicon.ico")
def icon() -> Response:
    """The icon that browsers request by default."""
    return Response(_file("icon.svg") or b"", media_type=KINDS["svg"], headers={"cache-control": FOREVER})


@cache
def _bundle() -> bytes:
    return (files("pipelines.workbench") / "static" / "vendor" / f"{PLOTLY}.gz").read_bytes()


@cache
def _file(name: str) -> bytes | None:
    """The content of a file; None if it does not exist."""
    known = {path.name: path for path in (files("pipelines.workbench") / "static").iterdir() if path.is_file()}
    known[PAINT] = files("pipelines.drawing") / PAINT
    return known[name].read_bytes() if name in known and name.rpartition(".")[2] in KINDS else None
