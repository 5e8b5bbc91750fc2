"""Sets up what commands share on a terminal: results on one stream, progress and errors on the other, tables.

A command that is quiet does not load rich.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, Task, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

from kinertia.cli.compiling import compile_once
from kinertia.errors import BlockedError, FileError, KinertiaError

if TYPE_CHECKING:
    from rich.console import Capture
    from rich.table import Table


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


def show_problem(error: KinertiaError, of: str = "") -> None:
    """Show one line per finding that stopped something, or for the error; `of` states whose it is among several."""
    also = error.also if isinstance(error, FileError) else ()
    for line in str(error).split("\n") if isinstance(error, BlockedError) else map(str, (error, *also)):
        show_error(f"{of}{line}")
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


class _TimeLeftColumn(TimeRemainingColumn):
    """Column with the time left, labelled as such; empty as long as it is unknown."""

    def render(self, task: Task) -> Text:
        return super().render(task).append(" left") if task.time_remaining else Text()


@contextmanager
def shown_bar(console: Console) -> Iterator[Callable[[str, float], None]]:
    """Show a bar for every stage; yields a function that takes the stage's name and its share done."""
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
