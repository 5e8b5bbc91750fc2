"""Maps the addresses of results to handlers: files, letter, comparisons, norms, copies."""

import shutil
from collections.abc import Iterable
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import BaseRoute, Route

from kinertia.cli.web.jobs import Jobs
from kinertia.cli.web.library import Library, PersonFolder
from kinertia.cli.web.person_page import person_page
from kinertia.cli.web.responses import RESULT_POLICY, archive, chosen_folder, expect, form, page, pairs, result_file, to
from kinertia.errors import KinertiaError
from kinertia.io.output_folder import complete_folder, expect_own_folder


def result_routes(library: Library, jobs: Jobs) -> list[BaseRoute]:
    """Return the routes of results of a library."""
    actions = _Results(library, jobs)
    return [
        Route("/compare", actions.compare),
        Route("/compare/page", actions.compared),
        Route("/norms", actions.norms, methods=["POST"]),
        Route("/people/{name}/results.zip", actions.zipped),
        Route("/people/{name}/letter", actions.letter),
        Route("/people/{name}/copy", actions.copy, methods=["POST"]),
        Route("/people/{name}/check/{file:path}", actions.check_file),
        Route("/people/{name}/results/{file:path}", actions.file),
        Route("/people/{name}/comparison/{file:path}", actions.comparison_file),
    ]


class _Results:
    """Handlers of the addresses."""

    def __init__(self, library: Library, jobs: Jobs) -> None:
        self._library = library
        self._jobs = jobs

    async def check_file(self, request: Request) -> Response:
        """Serve a file that `check` wrote."""
        return result_file(self._person(request).check, request.path_params["file"])

    async def file(self, request: Request) -> Response:
        """Serve a file of the results."""
        return result_file(self._person(request).results, request.path_params["file"])

    async def comparison_file(self, request: Request) -> Response:
        """Serve a file of the comparison of conditions."""
        return result_file(self._person(request).comparison, request.path_params["file"])

    async def zipped(self, request: Request) -> Response:
        """Serve all results as an archive."""
        person = self._person(request)
        if not person.fitted:
            raise HTTPException(404, "there are no results yet")
        return await run_in_threadpool(archive, person)

    async def copy(self, request: Request) -> Response:
        """Write the results into a folder that the user chooses."""
        person = self._person(request)
        try:
            folder = chosen_folder((await form(request)).get("folder", ""))
            await run_in_threadpool(_copied, person, folder)
        except KinertiaError as error:
            return await run_in_threadpool(person_page, request, person, self._jobs, str(error))
        return await run_in_threadpool(person_page, request, person, self._jobs, said=f"The results are in {folder}.")

    async def compare(self, request: Request) -> Response:
        """Show the comparison of chosen results."""
        from kinertia.report.comparison.side_by_side import MOST_FITS

        chosen = self._chosen(request)
        problem = "" if 2 <= len(chosen) <= MOST_FITS else f"Choose 2 to {MOST_FITS} people with results."
        return page(request, "compare.html.j2", people=chosen, problem=problem, query=request.url.query)

    async def compared(self, request: Request) -> Response:
        """Serve what `kinertia compare` writes about them."""
        from kinertia.cli.web.person_page import people_compared
        from kinertia.report.comparison.side_by_side import MOST_FITS

        chosen = self._chosen(request)
        if not 2 <= len(chosen) <= MOST_FITS:
            raise HTTPException(404, "nothing to compare")
        return _result(await run_in_threadpool(people_compared, chosen, self._library))

    async def letter(self, request: Request) -> Response:
        """Serve the letter of a person, to be printed."""
        from kinertia.cli.web.person_page import letter

        person = self._person(request)
        if not person.fitted:
            raise HTTPException(404, "there are no results yet")
        return _result(await run_in_threadpool(letter, person, self._library))

    async def norms(self, request: Request) -> Response:
        """Make the library's norms from the results of the chosen people."""
        from kinertia.cli.web.person_page import make_norms

        names = dict.fromkeys(value for key, value in await pairs(request) if key == "person")
        chosen = self._fitted(names)
        if not chosen:
            raise KinertiaError("choose the controls: people without pathology who have results")
        await run_in_threadpool(make_norms, chosen, self._library)
        return to(request, "")

    def _person(self, request: Request) -> PersonFolder:
        return expect(self._library.person(request.path_params["name"]))

    def _chosen(self, request: Request) -> list[PersonFolder]:
        return self._fitted(dict.fromkeys(request.query_params.getlist("person")))

    def _fitted(self, names: Iterable[str]) -> list[PersonFolder]:
        people = [self._library.person(name) for name in names]
        return [person for person in people if person is not None and person.fitted]


def _result(text: str) -> HTMLResponse:
    """Serve a page of results, with its own scripts, in isolation."""
    return HTMLResponse(text, headers={"content-security-policy": RESULT_POLICY})


def _copied(person: PersonFolder, folder: Path) -> None:
    """Copy the results to another folder, completely or not at all."""
    expect_own_folder(folder)
    with complete_folder(folder, "fit") as work:
        shutil.copytree(person.results, work, ignore=shutil.ignore_patterns(".*"), dirs_exist_ok=True)
