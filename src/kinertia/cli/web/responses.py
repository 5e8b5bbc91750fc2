"""Makes responses: pages from templates, files of results, and errors of forms."""

import mimetypes
import tempfile
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, cast
from urllib.parse import parse_qsl, quote

import jinja2
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, RedirectResponse, Response, StreamingResponse

from kinertia.cli.web.guard import RESULT_POLICY
from kinertia.cli.web.jobs import Work
from kinertia.cli.web.library import PersonFolder
from kinertia.errors import FileError
from kinertia.io.versions import VERSION
from kinertia.report.pages.rendering import templates_of

_LARGEST_FORM = 1_000_000
_PIECE = 1 << 20


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
    """Read the fields of a form by name, the last of each.

    Raises:
        HTTPException: it is larger than any of our forms.
    """
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > _LARGEST_FORM:
            raise HTTPException(413, "too large for a form")
    return dict(parse_qsl(body.decode("utf-8", errors="replace"), keep_blank_values=True))


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
