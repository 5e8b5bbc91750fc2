"""Lists the commands, loads each when it is called, and describes internal errors in one line and a log file."""

import platform
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, NoReturn, cast

import typer

from kinertia.cli.common import add_command, err, of_error, out, print_json, show_error, show_problem
from kinertia.errors import KinertiaError, internal_error
from kinertia.findings.extensions import ExtensionError
from kinertia.io.file_names import command_line
from kinertia.io.output_folder import INTERRUPTIONS
from kinertia.io.versions import VERSION

# typer keeps these line ends: at most 78 columns
_MANUAL = """Body segment parameters from gait.

Markers and ground reaction forces in; masses, centres of mass and inertias of
all segments out, with a motion that they and the forces explain.

[bold]In which order[/]

kinertia demo                 see it work, on a synthetic person
kinertia demo --measured      see it work on a measured walk (0.9 MB)
kinertia app                  all of it on a page in your browser
kinertia init FOLDER          draft FOLDER/subject.toml from your files
kinertia check subject.toml   can a fit use them? gaps, plates, axes, mass
kinertia fit subject.toml     estimate; the results go to the folder out
kinertia compare out1 out2    what differs between fits, and by how much
kinertia export out --csv     all tables of a fit, for other programs
kinertia cohort STUDY -o out  fit hundreds of people, resumable, one table
kinertia explain P213         what a finding means, and what to do about it

Each command has details and an example under --help.

[bold]What it needs[/]

A static trial (the person standing; C3D or TRC), one or more gait trials with
force plates (C3D, or TRC with MOT or STO; Qualisys' TSV, Vicon's CSV), body
mass, stature and sex.
Or, with fit --model, your scaled OpenSim model (.osim), trials and body mass.

[bold]Exit status[/]

  0  done
  1  done, but an ERROR was found. In fit: not converged; physically impossible
     segments; segments that contradict the literature; markers or residuals
     beyond OpenSim's guideline (markers 20 mm RMS; force 10 N RMS, 25 N peak,
     5 % of the largest external force; moment 50 N m RMS, 75 N m peak); or a
     trial was left out. In check: a recording or a model cannot be used.
     In cohort: any of these for a person, or a person could not be fitted.
  2  nothing could be computed: errors in files or options, one line each
 70  internal error; the line gives the log file
130  interrupted; nothing half-written is left

Results go to standard output, progress and errors to standard error; with
--json the results are JSON, for scripts.
"""
_MODULES = {
    "demo": "demo",
    "app": "app",
    "init": "drafts",
    "check": "check",
    "fit": "fit",
    "compare": "results",
    "export": "results",
    "cohort": "cohort",
    "explain": "findings",
}
_MORE = {
    "markers": "drafts",
    "report": "results",
    "crossval": "studies",
    "plan": "studies",
    "instruments": "learning",
    "norms": "learning",
    "population": "learning",
    "study": "studies",
    "warm-up": "app",
}
"""Module of every command, which has its name there (with underscores); in the order of `kinertia --help`."""
RENAMED = {"--force": "--overwrite"}
"""Old names, each with what it is called now; they go with the next version."""
MOVED = {f"study {name}": f"python -m validation {name}" for name in ("accuracy", "faults", "populations")}
"""Commands that are no longer installed, each with what to run in a clone of the repository."""
STATUS = 70
"""EX_SOFTWARE of sysexits.h: the fault is the program's."""
_PACKAGES = ("numpy", "scipy", "numba", "pandas", "ezc3d", "pydantic", "typer", "rich")


def application(only: str | None = None) -> typer.Typer:
    """Build the command line with all its commands, or with only one, so that the others need not be loaded."""
    app = typer.Typer(
        name="kinertia",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
        help=_MANUAL,
    )
    app.callback()(_root)
    modules = _MODULES | _MORE
    for name in modules if only is None else (only,):
        command = getattr(import_module(f"kinertia.cli.{modules[name]}"), name.replace("-", "_"))
        panel = "More" if name in _MORE else None
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name, rich_help_panel=panel)
        else:
            add_command(app, command, name, panel)
    return app


_INTERRUPTED = 130
"""Exit status after Ctrl-C."""
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""What typer raises for options and arguments that cannot be, under no public name."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line with `arguments`; by default those that this process was started with."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    run(application_for(given), given)


def application_for(given: Sequence[str]) -> typer.Typer:
    """Build the command line for these arguments."""
    return application(given[0] if given and given[0] in _MODULES | _MORE else None)


def run(app: typer.Typer, given: Sequence[str]) -> None:
    """Run the command line; a user's error is one line and exit status 2, a failure of Kinertia one line and 70.

    With `--json` both are JSON on standard output, too.
    """
    as_json = "--json" in given
    try:
        with _ended_in_order():
            _call(app, as_named_now(given), as_json)
    except KinertiaError as error:
        if as_json:
            print_json(of_error(error))
        show_problem(error)
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        problem = f"{where}{error.strerror or error}; check the path, its permissions and the space on the disk"
        _show(problem, as_json)
    except ExtensionError as error:
        _show(str(error), as_json)
    except Exception as error:
        # Ctrl-C in the middle of a compiled function, which reports it so
        cause: BaseException | None = error
        while isinstance(cause, SystemError):
            cause = cause.__cause__
        if isinstance(cause, KeyboardInterrupt | SystemExit):
            raise SystemExit(getattr(cause, "code", _INTERRUPTED)) from None
        _show(failure_text(error, given), as_json)
        raise SystemExit(STATUS) from None
    raise SystemExit(2)


def _call(app: typer.Typer, given: Sequence[str], as_json: bool) -> NoReturn:
    """Call the command and exit; a wrong option or argument is an error like others where scripts read it."""
    if not as_json:
        app(args=given, prog_name="kinertia")
    try:
        status = app(args=given, prog_name="kinertia", standalone_mode=False)
    except _UsageError as error:
        raise KinertiaError(cast(Any, error).format_message()) from None
    raise SystemExit(status)


def _show(problem: str, as_json: bool) -> None:
    """Show a problem that no finding describes, on standard output as well where scripts read it."""
    if as_json:
        print_json({"error": problem, "findings": []})
    show_error(problem)


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Handle termination signals and a closed terminal like Ctrl-C: nothing half-written is left."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heeded = [number for number in INTERRUPTIONS if signal.getsignal(number) == signal.SIG_DFL]  # nohup: ignored
    for number in heeded:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number in heeded:
            signal.signal(number, signal.SIG_DFL)


def _end(number: int, _: object) -> NoReturn:
    raise SystemExit(128 + number)


def _version(wanted: bool) -> None:
    if wanted:
        out.print(VERSION)
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def as_named_now(given: Sequence[str]) -> list[str]:
    """Replace old names of options among these arguments, with a notice on standard error.

    Raises:
        KinertiaError: the command is no longer installed.
    """
    command = " ".join(given[:2])
    if command in MOVED:
        raise KinertiaError(f"kinertia {command} moved to the repository: run {MOVED[command]} in a clone of it")
    for old in [name for name in RENAMED if name in given]:
        err.print(f"{old} is now {RENAMED[old]}; the old name will be removed in the next version")
    return [RENAMED.get(argument, argument) for argument in given]


def failure_text(error: Exception, given: Sequence[str]) -> str:
    """Log an internal error of Kinertia, and describe it and where its log is."""
    return internal_error(error, _logged(error, given) or "this line and your command")


def _logged(error: Exception, given: Sequence[str]) -> Path | None:
    """Write the log file: command, versions and traceback; None where no file can be written."""
    text = "\n".join(
        [
            command_line(["kinertia", *given]),
            f"kinertia {VERSION}, Python {platform.python_version()}, {platform.platform()}",
            ", ".join(f"{name} {_installed(name)}" for name in _PACKAGES),
            "",
            "".join(traceback.format_exception(error)),
        ]
    )
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="kinertia-failure-", suffix=".log", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write(text)
    except OSError:
        return None
    return Path(file.name)


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "missing"
