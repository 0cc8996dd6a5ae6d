"""The technician's page: the files of daemon/page, as they are."""

import hashlib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Final

from fastapi import APIRouter, Request, Response
from starlette.exceptions import HTTPException

router = APIRouter(include_in_schema=False)

MEDIA_TYPES: Final = {
    "css": "text/css; charset=utf-8",
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
POLICY: Final = "default-src 'self'; img-src 'self' blob: data:; base-uri 'none'; frame-ancestors 'none'"
"""Nothing from elsewhere, and no script or style but the page's own files."""
INDEX: Final = "index.html"


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file as it is sent, and what tells it from other versions of itself."""

    content: bytes
    media_type: str
    tag: str


@cache
def page_files() -> dict[str, PageFile]:
    """Return the page's files by name: read once, so that all of them are of one version."""
    found = {}
    for file in files("daemon").joinpath("page").iterdir():
        media_type = MEDIA_TYPES.get(file.name.rpartition(".")[2])
        if media_type is not None:
            content = file.read_bytes()
            found[file.name] = PageFile(content, media_type, f'"{hashlib.sha256(content).hexdigest()[:32]}"')
    return found


@router.get("/")
async def get_page(request: Request) -> Response:
    """Answer with the page itself; all that it refers to is relative to its address."""
    return _sent(request, page_files()[INDEX])


@router.get("/page/{file}")
async def get_page_file(file: str, request: Request) -> Response:
    """Answer with a script, a style or a picture of the page."""
    found = page_files().get(file)
    if found is None or file == INDEX:
        raise HTTPException(404)
    return _sent(request, found)


def _sent(request: Request, file: PageFile) -> Response:
    headers = {
        "ETag": file.tag,
        "Cache-Control": "no-cache",  # kept, and asked for again: a daemon that was updated has another page
        "Content-Security-Policy": POLICY,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
    }
    if file.tag in request.headers.get("If-None-Match", ""):
        return Response(status_code=304, headers=headers)
    return Response(file.content, media_type=file.media_type, headers=headers)
