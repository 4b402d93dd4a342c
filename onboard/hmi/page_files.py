"""Serves the files of a page from memory, with headers that forbid content of other origins."""

from collections.abc import Awaitable, Callable, Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable

from aiohttp import web

CONTENT_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".woff2": "font/woff2",
    ".txt": "text/plain; charset=utf-8",
}
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; font-src 'self';"
        " connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
"""Of every response: no inline script, no style attribute, no file of another origin."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def read_page(package: str) -> dict[str, tuple[bytes, str]]:
    """Return content and content type of the files in `page/` of a package, by their path."""
    return dict(_read(files(package) / "page", ""))


def add_page(app: web.Application, pages: Mapping[str, tuple[bytes, str]]) -> None:
    """Serve the files of `pages` at their paths, and `index.html` also at `/`."""

    async def send(request: web.Request) -> web.Response:
        name = request.match_info["path"] or "index.html"
        if name not in pages:
            raise web.HTTPNotFound
        body, content_type = pages[name]
        return web.Response(body=body, headers={"Content-Type": content_type})

    app.router.add_get("/{path:.*}", send)


async def with_headers(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Add `HEADERS` to the response of `handler`, also to an error."""
    try:
        response = await handler(request)
    except web.HTTPException as error:
        error.headers.update(HEADERS)
        raise
    if not response.prepared:
        response.headers.update(HEADERS)
    return response


def _read(folder: Traversable, prefix: str) -> list[tuple[str, tuple[bytes, str]]]:
    entries = []
    for entry in folder.iterdir():
        path = prefix + entry.name
        if entry.is_dir():
            entries += _read(entry, f"{path}/")
        else:
            suffix = entry.name[entry.name.rfind(".") :]
            entries.append((path, (entry.read_bytes(), CONTENT_TYPES[suffix])))
    return entries
