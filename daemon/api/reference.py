"""The API's description as a page to read: no script, nothing from elsewhere, no need of the internet."""

from collections.abc import Iterator
from html import escape
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

router = APIRouter()

STYLE = (
    "body{font:1rem/1.5 system-ui,sans-serif;max-width:50rem;margin:2rem auto;padding:0 1rem}"
    ":root{color-scheme:light dark}"
    "code{font-family:ui-monospace,monospace}h3{margin:1.5rem 0 0}ul{margin:.3rem 0}"
)


@router.get("/docs", include_in_schema=False)
async def get_reference(request: Request) -> HTMLResponse:
    """Answer with every operation, by what it is about."""
    return HTMLResponse("".join(_page(request.app.openapi())))


def _page(api: dict[str, Any]) -> Iterator[str]:
    info = api["info"]
    yield f"<!doctype html><html lang=en><meta charset=utf-8><title>{escape(info['title'])}</title>"
    yield f"<meta name=viewport content='width=device-width'><style>{STYLE}</style>"
    yield f"<h1>{escape(info['title'])} {escape(info['version'])}</h1>"
    for paragraph in info["description"].strip().split("\n\n"):
        yield f"<p>{escape(paragraph)}</p>"
    yield "<p>The same for programs, with every field: <a href='api/v1/openapi.json'>openapi.json</a></p>"
    for tag in api["tags"]:
        yield f"<h2>{escape(tag['name'])}</h2><p>{escape(tag['description'])}</p>"
        for path, operations in api["paths"].items():
            for method, operation in operations.items():
                if tag["name"] in operation["tags"]:
                    yield from _operation(method, path, operation)


def _operation(method: str, path: str, operation: dict[str, Any]) -> Iterator[str]:
    yield f"<h3><code>{method.upper()} {escape(path)}</code></h3><p><b>{escape(operation['summary'])}.</b> "
    yield f"{escape(operation['description'])}</p><ul>"
    if role := operation.get("x-role"):
        yield f"<li>Role: {escape(role)}</li>"
    for parameter in operation.get("parameters", ()):
        text = parameter.get("description", "")
        yield f"<li><code>{escape(parameter['name'])}</code> ({parameter['in']}): {escape(text)}</li>"
    for status, answer in operation["responses"].items():
        yield f"<li>{status}: {escape(answer['description']).replace('`', '')}</li>"
    yield "</ul>"
