"""Defines `kinertia app`, the local page on this computer only, and `kinertia warm-up`, which compiles beforehand."""

import webbrowser
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.common import Outcome, Quiet, out, print_json, shown_progress
from kinertia.cli.demo import write_measured_lab, write_synthetic_lab
from kinertia.errors import KinertiaError, how_to_install
from kinertia.model.compiled import cache_folder, is_compiled

_EXAMPLES: dict[str, Callable[[Path], object]] = {"measured": write_measured_lab, "synthetic": write_synthetic_lab}


def app(
    folder: Annotated[
        Path | None, typer.Option(help="Library of people and their results (default: Kinertia in your home folder).")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 takes a free one.")] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only show the address.")] = False,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print the address and library as JSON before the server starts, for scripts."),
    ] = False,
) -> None:
    """Check, fit and read reports in the browser, with files dropped on a page.

    The page is served on this computer to this computer only, at an address with a secret part; nothing is sent
    anywhere. Its data stay in a folder of yours, in the form that the other commands read. It ends with Ctrl-C or the
    button on the page. Needs pip install ".\\[app]".

    [bold]Examples[/]

    kinertia app

    kinertia app --folder D:/gait --no-browser
    """
    try:
        from kinertia.cli.web.library import Library
        from kinertia.cli.web.server import Server
    except ImportError as error:
        if (error.name or str(error)).partition(".")[0] not in ("starlette", "uvicorn", "anyio"):
            raise
        problem = f"kinertia app needs starlette and uvicorn, which are not installed: {how_to_install('app')}"
        raise KinertiaError(problem) from None
    library = Library(Path.home() / "Kinertia" if folder is None else folder)
    with library.opened():
        server = Server(library, port, _EXAMPLES, prepare=True)
        if as_json:
            print_json({"address": server.address, "library": str(library.folder)})
        else:
            out.print(f"Kinertia is at {server.address}", soft_wrap=True)
            out.print(f"library: {library.folder}; Ctrl-C ends it", soft_wrap=True)
        if not no_browser:
            webbrowser.open(server.address)
        with suppress(KeyboardInterrupt):
            server.run()
    if not as_json:
        out.print("stopped; all finished results are in the library")


def warm_up(quiet: Quiet = False) -> Outcome:
    """Compile beforehand what the first fit would compile.

    Kinertia's calculations are compiled once on a machine, which takes about
    half a minute; any command that computes does it if necessary. The result is
    kept beside the package or, where that cannot be written to, in your cache:
    run this once as the owner of an installation that others may only read,
    and on a cluster before the jobs start.

    [bold]Example[/]

    kinertia warm-up
    """
    done = is_compiled()
    with shown_progress():
        pass
    out.print(f"{'compiled already' if done else 'compiled'}: {cache_folder()}", soft_wrap=True)
    return Outcome({"compiled_before": done, "folder": str(cache_folder())})
