"""Maps addresses to handlers. Everything is a page, a form or a file; the state is in the library's folders."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

from kinertia.cli.web.entries import recognise, trouble, write_form, write_text
from kinertia.cli.web.jobs import KINDS, Jobs
from kinertia.cli.web.library import ENDINGS, LIMITS, Library, PersonFolder, receive
from kinertia.cli.web.marker_page import marker_routes
from kinertia.cli.web.person_page import person_page, progress, standing
from kinertia.cli.web.remedies import apply, undo
from kinertia.cli.web.responses import (
    expect,
    form,
    page,
    result_file,
    time_left,
    to,
)
from kinertia.cli.web.result_routes import result_routes
from kinertia.errors import KinertiaError, internal_error
from kinertia.io.samples import SIZE_MB
from kinertia.io.subject.body_files import measures_sheet
from kinertia.report.figures.measures_picture import measures_picture

Example = Callable[[Path], object]
"""Writes the files of a person to try the page with into a folder."""
_STATIC = Path(__file__).with_name("static")
_FORMS = (
    *("files", "recognise", "remove", "entries", "keep", "text", "remedy", "undo", "delete", "copy", "rename"),
    *KINDS,
)
"""Addresses below a person's that forms are sent to."""
_SECTIONS = {"check": "check", "fit": "results", "comparison": "comparison"}
"""Section of a person's page that shows the progress of a check, a fit or a comparison."""


def application(library: Library, jobs: Jobs, stop: Callable[[], None], examples: Mapping[str, Example]) -> Starlette:
    """Build the application of a library; `stop` ends the server, `examples` by kind are people to try it with."""
    actions = _Actions(library, jobs, stop, examples)
    routes: list[BaseRoute] = [
        Route("/", actions.home),
        Route("/people", actions.add, methods=["POST"]),
        Route("/example/{kind}", actions.add_example, methods=["POST"]),
        Route("/measures.csv", actions.measures_sheet),
        Route("/measures.svg", actions.measures_picture),
        Route("/preparing", actions.preparing),
        Route("/stop", actions.end, methods=["POST"]),
        Route("/people/{name}", actions.person),
        Route("/people/{name}/files", actions.upload, methods=["POST"]),
        Route("/people/{name}/recognise", actions.recognised, methods=["POST"]),
        Route("/people/{name}/remove", actions.remove, methods=["POST"]),
        Route("/people/{name}/entries", actions.entries, methods=["POST"]),
        Route("/people/{name}/keep", actions.keep, methods=["POST"]),
        Route("/people/{name}/text", actions.text, methods=["POST"]),
        Route("/people/{name}/remedy", actions.remedy, methods=["POST"]),
        Route("/people/{name}/undo", actions.undo, methods=["POST"]),
        Route("/people/{name}/rename", actions.rename, methods=["POST"]),
        Route("/people/{name}/delete", actions.delete, methods=["POST"]),
        Route("/people/{name}/progress", actions.progress),
        Route("/people/{name}/subject.toml", actions.subject_file),
        *marker_routes(library, jobs),
        *result_routes(library, jobs),
        Route("/people/{name}/{kind}", actions.start, methods=["POST"]),
        Route("/people/{name}/{kind}/cancel", actions.cancel, methods=["POST"]),
        Route("/people/{name}/{action}", actions.back),
        Mount("/static", StaticFiles(directory=_STATIC)),
    ]
    handlers = {HTTPException: _not_found, KinertiaError: _trouble, OSError: _no_file, Exception: _failed}
    served = Starlette(routes=routes, exception_handlers=handlers)
    served.state.jobs = jobs
    return served


class _Actions:
    """Handlers of the addresses."""

    def __init__(self, library: Library, jobs: Jobs, stop: Callable[[], None], examples: Mapping[str, Example]) -> None:
        self._library = library
        self._jobs = jobs
        self._stop = stop
        self._examples = examples

    async def home(self, request: Request) -> Response:
        """List all people in the library, with a place to drop files for a new person."""
        people = [standing(person, self._jobs) for person in self._library.people()]
        return page(
            request,
            "home.html.j2",
            people=people,
            folder=self._library.folder,
            norms=self._library.norms.is_file(),
            limits=LIMITS,
            examples=tuple(self._examples),
            size_mb=SIZE_MB,
        )

    async def add(self, request: Request) -> Response:
        """Add a new person and go to their page, or return its address to a script."""
        person = self._library.add((await form(request)).get("name", ""))
        answer = to(request, "people", person.name)
        wants_json = "application/json" in request.headers.get("accept", "")
        return JSONResponse({"address": answer.headers["location"]}) if wants_json else answer

    async def add_example(self, request: Request) -> Response:
        """Add an example person, ready to be checked and fitted; if one is not available, the others are added."""
        kind = request.path_params["kind"]
        if kind not in self._examples:
            raise HTTPException(404, "there is no such example")
        with TemporaryDirectory() as folder:
            try:
                await run_in_threadpool(self._examples[kind], Path(folder))
            except KinertiaError as error:
                others = [other for other in self._examples if other != kind]
                return page(request, "trouble.html.j2", 422, sentence=str(error), examples=others, size_mb=SIZE_MB)
            person = self._library.add(f"Example, {kind}")
            for path in Path(folder).iterdir():
                if path.suffix.lower() in ENDINGS:
                    shutil.copyfile(path, person.folder / path.name)
        await run_in_threadpool(recognise, person)
        self._jobs.add(person, "check")
        return to(request, "people", person.name)

    async def person(self, request: Request) -> Response:
        """Show one person: files, entries, check, results."""
        return await run_in_threadpool(person_page, request, self._person(request), self._jobs)

    async def upload(self, request: Request) -> Response:
        """Receive one dropped file as the body of the request; answer with what is wrong with it, if anything."""
        person = self._idle(request)
        try:
            path = await receive(person, request.query_params.get("name", ""), request.stream())
        except KinertiaError as error:
            return JSONResponse({"problem": str(error)}, 422)
        return JSONResponse({"name": path.name})

    async def recognised(self, request: Request) -> Response:
        """Draft the subject file after files were dropped; its problems are shown on the person's page."""
        person = self._idle(request)
        await run_in_threadpool(_recognised, person)
        return to(request, "people", person.name)

    async def remove(self, request: Request) -> Response:
        """Remove one file."""
        person = self._idle(request)
        name = (await form(request)).get("file")
        for path in person.files():
            if path.name == name:
                path.unlink()
        await run_in_threadpool(_recognised, person)
        return to(request, "people", person.name)

    async def entries(self, request: Request) -> Response:
        """Save the form, and check the files if nothing is wrong with it."""
        person = self._idle(request)
        given = await form(request)
        try:
            write_form(person, given)
        except KinertiaError as error:
            return await run_in_threadpool(person_page, request, person, self._jobs, str(error), given)
        return self._checked(request, person)

    async def keep(self, request: Request) -> Response:
        """Save the form before another page replaces it, such as the page without a removed file."""
        person = self._idle(request)
        if person.subject.is_file():
            write_form(person, await form(request))
        return JSONResponse({})

    async def text(self, request: Request) -> Response:
        """Save the subject file as it was typed, and check the files if nothing is wrong with it."""
        person = self._idle(request)
        typed = (await form(request)).get("text", "")
        try:
            write_text(person, typed)
        except KinertiaError as error:
            return await run_in_threadpool(person_page, request, person, self._jobs, str(error), text_typed=typed)
        return self._checked(request, person)

    async def remedy(self, request: Request) -> Response:
        """Write the setting of a remedy that a finding proposes, and check again."""
        person, given = self._idle(request), await form(request)
        try:
            await run_in_threadpool(apply, person, given.get("setting", ""), given.get("reason", ""))
        except KinertiaError as error:
            return await run_in_threadpool(person_page, request, person, self._jobs, str(error))
        return self._checked(request, person)

    async def undo(self, request: Request) -> Response:
        """Restore what stood in place of a remedy's setting, and check again."""
        person, given = self._idle(request), await form(request)
        await run_in_threadpool(undo, person, given.get("setting", ""))
        return self._checked(request, person)

    async def start(self, request: Request) -> Response:
        """Queue a check or a fit, with the entries of the form if it was sent; or the comparison of two conditions."""
        person, kind = self._person(request), self._kind(request)
        given = await form(request)
        if kind == "comparison":
            self._jobs.add(person, kind, given.get("before", ""), given.get("after", ""))
            return to(request, "people", person.name, section=_SECTIONS[kind])
        if given and not self._jobs.busy(person):
            try:
                write_form(person, given)
            except KinertiaError as error:
                return await run_in_threadpool(person_page, request, person, self._jobs, str(error), given)
        if not trouble(person):
            self._jobs.add(person, kind)
        return to(request, "people", person.name, section=_SECTIONS[kind])

    async def cancel(self, request: Request) -> Response:
        """Cancel a check or a fit."""
        person, kind = self._person(request), self._kind(request)
        await run_in_threadpool(self._jobs.cancel, person, kind)
        return to(request, "people", person.name, section=_SECTIONS[kind])

    async def back(self, request: Request) -> Response:
        """Show the person's page when the address of a form is opened, as from the browser's history."""
        if request.path_params["action"] not in _FORMS:
            raise HTTPException(404, "no such page")
        return to(request, "people", self._person(request).name)

    async def progress(self, request: Request) -> Response:
        """Return the progress of the person's check, fit and comparison."""
        return JSONResponse(progress(self._person(request), self._jobs))

    async def preparing(self, request: Request) -> Response:
        """Return the time left until the first estimate can begin, in words; null once it can."""
        work = self._jobs.preparing
        return JSONResponse({"left": None if work is None else time_left(work)})

    async def rename(self, request: Request) -> Response:
        """Give the person another name in the library; nothing else changes."""
        person = self._idle(request)
        renamed = self._library.rename(person, (await form(request)).get("name", ""))
        return to(request, "people", renamed.name)

    async def delete(self, request: Request) -> Response:
        """Delete the person with files and results; a running fit is cancelled."""
        person = self._person(request)
        for kind in KINDS:
            await run_in_threadpool(self._jobs.cancel, person, kind)
        await run_in_threadpool(self._library.delete, person)
        return to(request, "")

    async def subject_file(self, request: Request) -> Response:
        """Serve the subject file, to be saved."""
        return result_file(self._person(request).folder, "subject.toml")

    async def measures_sheet(self, request: Request) -> Response:
        """Serve the empty sheet of girths and lengths that `kinertia init --measures` writes, to be saved."""
        return Response(measures_sheet(), media_type="text/csv")

    async def measures_picture(self, request: Request) -> Response:
        """Serve the picture of where to measure, to be saved."""
        return Response(measures_picture(), media_type="image/svg+xml")

    async def end(self, request: Request) -> Response:
        """Stop the server."""
        self._stop()
        return page(request, "ended.html.j2")

    def _person(self, request: Request) -> PersonFolder:
        return expect(self._library.person(request.path_params["name"]))

    def _idle(self, request: Request) -> PersonFolder:
        person = self._person(request)
        if self._jobs.busy(person):
            raise HTTPException(409, "wait for the check or fit of this person, or cancel it, before changing anything")
        return person

    def _kind(self, request: Request) -> str:
        kind: str = request.path_params["kind"]
        if kind not in KINDS:
            raise HTTPException(404, "no such action")
        return kind

    def _checked(self, request: Request, person: PersonFolder) -> Response:
        person.note(saved=True)
        if trouble(person):
            return to(request, "people", person.name)
        self._jobs.add(person, "check")
        return to(request, "people", person.name, section=_SECTIONS["check"])


def _recognised(person: PersonFolder) -> None:
    """Draft the subject file as far as possible; the person's page shows what is wrong."""
    try:
        recognise(person)
        person.note(draft="")
    except KinertiaError as error:
        person.note(draft=str(error))


async def _not_found(request: Request, error: Exception) -> Response:
    """Show that something was not found, in a page; scripts get it as JSON."""
    assert isinstance(error, HTTPException)
    return _error_page(request, error.detail, error.status_code)


async def _trouble(request: Request, error: Exception) -> Response:
    return _error_page(request, str(error), 422)


async def _no_file(request: Request, error: Exception) -> Response:
    """Report a full disk, or a folder that may not be written to."""
    assert isinstance(error, OSError)
    where = "" if error.filename is None else f"{error.filename}: "
    sentence = f"{where}{error.strerror or error}; check the path, its permissions and the space on the disk"
    return _error_page(request, sentence, 500)


async def _failed(request: Request, error: Exception) -> Response:
    """Report an internal error of Kinertia; the terminal has all of it."""
    return _error_page(request, internal_error(error, "what its terminal shows"), 500)


def _error_page(request: Request, sentence: str, status: int) -> Response:
    if "application/json" in request.headers.get("accept", ""):
        return JSONResponse({"problem": sentence}, status)
    content: dict[str, Any] = {"sentence": sentence}
    return page(request, "trouble.html.j2", status, **content)
