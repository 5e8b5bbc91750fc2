"""Admits requests from this browser only, and makes responses: pages, files of results, errors of forms.

Any web page may send requests to 127.0.0.1, and a name that leads there makes it read the answers too (DNS rebinding).
So every request needs the token and the server's own name in `Host`, and must not come from another site.
"""

import mimetypes
import secrets
import tempfile
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, cast
from urllib.parse import parse_qsl, quote

import jinja2
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import (
    FileResponse,
    HTMLResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
    StreamingResponse,
)
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from kinertia.cli.web.jobs import Work
from kinertia.cli.web.library import PersonFolder
from kinertia.errors import FileError
from kinertia.io.versions import VERSION
from kinertia.report.pages.rendering import templates_of

_LARGEST_FORM = 1_000_000
_PIECE = 1 << 20
HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "frame-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "same-origin",  # with no-referrer forms have no `Origin` that could be looked at
    "cache-control": "no-store",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}
"""Headers of every answer without its own: pages load nothing from elsewhere, and no other page may embed them."""
RESULT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; "
    "form-action 'none'; base-uri 'none'; frame-ancestors 'self'; sandbox allow-scripts allow-downloads allow-modals"
)
"""Content-Security-Policy of reports, which carry their own scripts: an origin of their own, which reaches nothing."""


@cache
def _environment() -> jinja2.Environment:
    environment = templates_of("kinertia.cli.web")
    environment.filters["in_address"] = lambda name: quote(name, safe="")
    environment.filters["megabytes"] = lambda size: f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.0f} kB"
    return environment


def page(request: Request, template: str, status: int = 200, **content: Any) -> HTMLResponse:
    """Render a page; `root` in it is where the application's addresses begin."""
    root, preparing = request.scope["root_path"], request.app.state.jobs.preparing
    left = "" if preparing is None else time_left(preparing)
    shared = {"root": root, "version": VERSION, "preparing": preparing is not None, "preparing_left": left}
    text = _environment().get_template(template).render(**shared, **content)
    return HTMLResponse(text.encode("utf-8", errors="replace"), status)


def time_left(work: Work) -> str:
    """Return the time left of the stage, in words; empty as long as it is unknown."""
    seconds = work.seconds_left()
    if seconds is None:
        return ""
    return f"about {seconds:.0f} s left" if seconds < 90 else f"about {seconds / 60:.0f} min left"


def to(request: Request, *parts: str, section: str = "") -> RedirectResponse:
    """Redirect to another page, or to a section of it, as after a form."""
    address = "/".join([request.scope["root_path"], *(quote(part, safe="") for part in parts)])
    return RedirectResponse(f"{address}#{section}" if section else address, 303)


async def form(request: Request) -> dict[str, str]:
    """Read the fields of a form by name, the last of each."""
    return dict(await pairs(request))


async def pairs(request: Request) -> list[tuple[str, str]]:
    """Read the fields of a form, name and value.

    Raises:
        HTTPException: it is larger than any of our forms.
    """
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > _LARGEST_FORM:
            raise HTTPException(413, "too large for a form")
    return parse_qsl(body.decode("utf-8", errors="replace"), keep_blank_values=True)


def result_file(folder: Path, name: str) -> Response:
    """Serve a file of results: pages to be shown in an isolated frame, the rest to be saved.

    Raises:
        HTTPException: no such file in the folder.
    """
    within = folder.resolve()
    path = (within / name).resolve()
    inside = path.is_relative_to(within) and path.is_file()
    if not inside or any(part.startswith(".") for part in path.relative_to(within).parts):
        raise HTTPException(404, "no such file")
    headers = {"content-security-policy": RESULT_POLICY}
    if path.suffix == ".html":
        return FileResponse(path, media_type="text/html", headers=headers)
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return FileResponse(path, media_type=kind, filename=path.name, headers=headers)


def archive(person: PersonFolder) -> Response:
    """Serve results and subject file as a zip archive."""
    file = cast(BinaryIO, tempfile.SpooledTemporaryFile(50_000_000))  # noqa: SIM115 - closed when it was sent
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        for path in sorted(person.results.rglob("*")):
            if path.is_file() and not path.name.startswith("."):
                packed.write(path, f"{person.name}/{path.relative_to(person.results).as_posix()}")
    size = file.tell()
    file.seek(0)

    def pieces() -> Iterator[bytes]:
        with file:
            while piece := file.read(_PIECE):
                yield piece

    name = quote(f"{person.name}.zip", safe="")
    headers = {"content-disposition": f"attachment; filename*=utf-8''{name}", "content-length": str(size)}
    return StreamingResponse(pieces(), media_type="application/zip", headers=headers)


def expect(person: PersonFolder | None) -> PersonFolder:
    """Return the person, who must exist.

    Raises:
        HTTPException: there is no person of that name.
    """
    if person is None:
        raise HTTPException(404, "no one of this name is in the library")
    return person


def chosen_folder(text: str) -> Path:
    """Parse a folder that a user typed.

    Raises:
        FileError: it is not an absolute path.
    """
    path = Path(text.strip().strip('"')).expanduser()
    if not path.is_absolute():
        raise FileError(text.strip() or "folder", "give the full path of the folder, starting at the drive or /")
    return path


class Guard:
    """Filter that passes requests to the application only if they have the token and come from no other site.

    The token is the first part of the path; the application sees it as its root.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app = app
        self._token = token
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":  # websockets are not used
            await send({"type": "websocket.close", "code": 1008})
            return
        refused = self._refusal(scope)

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        if refused:
            await PlainTextResponse(f"{refused}\n", 403)(scope, receive, sent)
            return
        await self._app({**scope, "root_path": f"/{self._token}"}, receive, sent)

    def _refusal(self, scope: Scope) -> str:
        """Return why a request is refused; empty if it is not."""
        headers = Headers(scope=scope)
        if headers.getlist("host") not in [[host] for host in self._hosts]:
            return "Kinertia answers on 127.0.0.1 only."
        given = scope["path"].split("/", 2)[1]
        if not secrets.compare_digest(given.encode(), self._token.encode()):
            return "This is not the address that kinertia app printed: open that one."
        origins: list[list[str]] = [[]] + [[f"http://{host}"] for host in self._hosts]
        site = headers.get("sec-fetch-site", "none")
        if headers.getlist("origin") not in origins or site not in ("none", "same-origin"):
            return "Kinertia does not answer requests from other sites."
        return ""
