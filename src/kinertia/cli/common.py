"""Defines what commands share: options, how they end, and results, progress and errors on a terminal.

A command that is quiet does not load rich.
"""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cached_property, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, get_type_hints

import typer

from kinertia.cli.compiling import compile_once
from kinertia.diagnostics.runner import unknown_codes
from kinertia.errors import BlockedError, FileError, KinertiaError, findings_of
from kinertia.findings.rule import matching
from kinertia.io.output_folder import check_folder, expect_own_folder
from kinertia.io.text.number_table import number_of
from kinertia.settings import Overrule, sex_of

if TYPE_CHECKING:
    from rich.console import Capture, Console
    from rich.progress import Task
    from rich.table import Table
    from rich.text import Text


class Stream:
    """One of the two standard streams.

    Attributes:
        quiet: whether nothing is written.
    """

    def __init__(self, stderr: bool = False) -> None:
        self.quiet = False
        self._stderr = stderr

    @cached_property
    def console(self) -> Console:
        """Console that writes to the stream."""
        from rich.console import Console

        # names of files and trials may contain what rich takes for markup
        return Console(markup=False, emoji=False, highlight=False, stderr=self._stderr)

    def print(self, *words: Any, **form: Any) -> None:
        """Print as `rich.console.Console.print` does."""
        if not self.quiet:
            self.console.print(*words, **form)

    def capture(self) -> Capture:
        """Capture what is written within a `with` block instead of showing it."""
        return self.console.capture()


out, err = Stream(), Stream(stderr=True)


def print_json(content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print results for scripts on standard output; numbers that are not finite are null, as JSON requires."""
    typer.echo(json.dumps(finite(content), indent=2, allow_nan=False))


def finite(content: Any) -> Any:
    """Replace numbers that are not finite by None."""
    if isinstance(content, Mapping):
        return {name: finite(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return [finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


def be_quiet(quiet: bool) -> bool:
    """Silence results and progress, or not; errors are always shown."""
    out.quiet = quiet
    return quiet


def show_error(message: str) -> None:
    """Show one error in one line."""
    from rich.text import Text

    text = Text("error: ", style="bold red").append(" ".join(message.split("\n")), style="not bold default")
    err.print(text, soft_wrap=True)


def show_problem(error: KinertiaError, prefix: str = "") -> None:
    """Show one line per finding that stopped something, or for the error; `prefix` states whose it is among several."""
    also = error.also if isinstance(error, FileError) else ()
    for line in str(error).split("\n") if isinstance(error, BlockedError) else map(str, (error, *also)):
        show_error(f"{prefix}{line}")
    for k, line in enumerate(getattr(error, "__notes__", ())):
        err.print(f"{'then' if k else 'next'}: {line}", soft_wrap=True, markup=False, highlight=False)


@contextmanager
def shown_progress() -> Iterator[Callable[[str, float], None]]:
    """Show the progress of the current stage: a bar with the time left on a terminal, a line per stage elsewhere.

    Yields a function that takes the stage's name and its share done. Code not yet compiled on this machine is
    compiled first.
    """
    with _shown_progress() as progress:
        compile_once(progress)
        yield progress


@contextmanager
def _shown_progress() -> Iterator[Callable[[str, float], None]]:
    if out.quiet:
        yield lambda stage, share: None
        return
    if err.console.is_terminal:
        with shown_bar(err.console) as move:
            yield move
        return
    seen: list[str] = []

    def line(stage: str, share: float) -> None:
        if stage not in seen:
            seen.append(stage)
            err.print(stage)

    yield line


def plain_table(*headings: str) -> Table:
    """Make a table with its first two columns to the left if the second has no heading, the numbers to the right."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=0)
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 or not heading else "right", overflow="fold")
    return table


@contextmanager
def shown_bar(console: Console) -> Iterator[Callable[[str, float], None]]:
    """Show a bar for every stage; yields a function that takes the stage's name and its share done."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.text import Text

    class _TimeLeftColumn(TimeRemainingColumn):
        """Column with the time left; it is empty while that is unknown."""

        def render(self, task: Task) -> Text:
            return super().render(task).append(" left") if task.time_remaining else Text()

    columns = (TextColumn("{task.description:>20}"), BarColumn(), TimeElapsedColumn(), _TimeLeftColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        shown: list[str] = []

        def move(stage: str, share: float) -> None:
            if shown != [stage]:
                shown[:] = [stage]
                for task in bar.task_ids:
                    bar.remove_task(task)
                bar.add_task(stage, total=None)  # a task of its own, or the time left would be that of all stages
            if share > 0:
                bar.update(bar.task_ids[-1], total=1.0, completed=share)

        yield move


_AS_JSON = Annotated[bool, typer.Option("--json", help="Print the results as JSON only, for scripts.")]


def results_folder(
    folder: Path, overwrite: bool, sub_folders: Collection[str] = (), files: Collection[str] = ()
) -> None:
    """Raise an error, before any work, if results cannot or may not go to a folder, or its `sub_folders`.

    Not all names of results are known so early; `files` lists those that are.

    Raises:
        FileError: it cannot be written to, or holds other files and `overwrite` is False.
    """
    if not overwrite:
        expect_own_folder(folder, ", or --overwrite to write among them")
    check_folder(folder, sub_folders, files)


def number(text: str) -> float:
    """Parse a number with a decimal point or a decimal comma.

    Raises:
        BadParameter: the text is not a number.
    """
    try:
        return number_of(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def sex(text: str) -> str:
    """Parse "male" or "female"; m and f are enough.

    Raises:
        BadParameter: the text is neither.
    """
    known = sex_of(text)
    if known not in ("male", "female"):
        raise typer.BadParameter(f"'{text}' is neither male (m) nor female (f); it selects the body tables")
    return str(known)


Sex = Annotated[
    str | None, typer.Option(parser=sex, metavar="SEX", help="male or female (m, f): selects the body tables.")
]
Mass = Annotated[
    float | None, typer.Option(parser=number, metavar="KG", help="Body mass, kg; a C3D file may contain it.")
]
Height = Annotated[
    float | None, typer.Option(parser=number, metavar="M", help="Stature, m; a C3D file may contain it.")
]
Static = Annotated[Path | None, typer.Option(help="Static trial (.c3d, .trc, .tsv, .csv).")]
Forces = Annotated[Path | None, typer.Option(help="Ground reactions (.mot, .sto, .forces); a C3D file has its own.")]
MarkerSetName = Annotated[
    str | None,
    typer.Option("--markers", help="Marker set: a preset or a TOML file; found from the labels if left out."),
]
ScaledModel = Annotated[
    Path | None,
    typer.Option("--model", help="Scaled OpenSim model (.osim), in place of --static, --sex and --height."),
]
Calibrate = Annotated[
    bool, typer.Option("--calibrate", help="Let markers and joint centres of the OpenSim model move.")
]
Waive = Annotated[
    list[str] | None,
    typer.Option("--waive", metavar="CODE", help="Go on in spite of this ERROR; shown as waived. May be repeated."),
]
Output = Annotated[Path, typer.Option("--output", "-o", help="Folder for the results; earlier ones are replaced.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Write even if the folder holds other files.")]
Loads = Annotated[
    Path | None,
    typer.Option("--loads", "--external-loads", help="OpenSim ExternalLoads (.xml) that explains the forces file."),
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", callback=be_quiet, help="Show errors only; the exit status gives the outcome.")
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Show every assumption and detail as well.")]


def overrule_of(waive: Sequence[str] | None) -> Overrule:
    """Parse the codes that `--waive` overrules.

    Raises:
        BadParameter: no such code, or one that cannot be waived.
    """
    overrule = Overrule(waive=tuple(code.upper() for code in waive or ()))
    for code in unknown_codes(overrule):
        hard = "cannot be waived: nothing can be computed with it" if matching(code) else "is not the code of a finding"
        raise typer.BadParameter(f"{code} {hard}; see kinertia explain {code[:1]}")
    return overrule


def own_file(output: Path, read: Callable[[Path], object], command: str) -> None:
    """Check that a command may write a file: a new one, or one of its own, which `read` can read.

    Raises:
        FileError: it is a folder, in no folder, or a file of another kind.
    """
    if output.is_dir():
        raise FileError(output, "a folder; give the name of a file")
    if not output.absolute().parent.is_dir():
        raise FileError(output, f"no such folder: {output.absolute().parent}")
    if output.exists():
        try:
            read(output)
        except FileError:
            raise FileError(output, f"not a file that {command} wrote; give another name with -o") from None


@dataclass(frozen=True)
class Outcome:
    """Result of a command for scripts, and its exit status.

    Attributes:
        content: result for scripts, as `--json` prints it; paths as text.
        status: exit status.
    """

    content: Mapping[str, Any] | Sequence[Any]
    status: int = 0


def add_command(
    app: typer.Typer, command: Callable[..., Any], name: str | None = None, panel: str | None = None
) -> None:
    """Register a command of `app`; one that returns an `Outcome` gets `--json`, which prints it instead of all text.

    A command that has an `as_json` of its own receives the option, too. `panel` is its heading in `kinertia --help`.
    """
    hints = get_type_hints(command, include_extras=True)
    app.command(name, rich_help_panel=panel)(_with_json(command, hints) if hints["return"] is Outcome else command)


def of_error(error: KinertiaError) -> dict[str, Any]:
    """Return an error for scripts: its text, its findings, and what to do next where that is known."""
    content: dict[str, Any] = {"error": str(error), "findings": [finding.to_dict() for finding in findings_of(error)]}
    notes = getattr(error, "__notes__", ())
    return {**content, "next": list(notes)} if notes else content


def _with_json(command: Callable[..., Outcome], hints: Mapping[str, Any]) -> Callable[..., NoReturn]:
    signature = inspect.signature(command)
    declared = "as_json" in signature.parameters

    @wraps(command)
    def run(*, as_json: bool, **given: Any) -> NoReturn:
        if declared:
            given["as_json"] = as_json
        with out.capture() if as_json else nullcontext():
            outcome = command(**given)
        if as_json:
            print_json(outcome.content)
        raise typer.Exit(outcome.status)

    if not declared:
        option = inspect.Parameter("as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=_AS_JSON)
        signature = signature.replace(parameters=[*signature.parameters.values(), option])
    annotated = [
        parameter.replace(annotation=hints.get(name, _AS_JSON)) for name, parameter in signature.parameters.items()
    ]
    run.__signature__ = signature.replace(parameters=annotated)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in annotated}
    return run
