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

from kinertia.cli.compiling import compile_once
from kinertia.errors import BlockedError, KinertiaError

if TYPE_CHECKING:
    from rich.console import Capture, Console
    from rich.table import Table


class Stream:
    """One of the two standard streams.

    Attributes:
        quiet: nothing is written.
    """

    def __init__(self, stderr: bool = False) -> None:
        self.quiet = False
        self._stderr = stderr

    @cached_property
    def console(self) -> Console:
        """What writes to it."""
        from rich.console import Console

        # names of files and trials may contain what rich takes for markup
        return Console(markup=False, emoji=False, highlight=False, stderr=self._stderr)

    def print(self, *words: Any, **form: Any) -> None:
        """As `rich.console.Console.print` does."""
        if not self.quiet:
            self.console.print(*words, **form)

    def capture(self) -> Capture:
        """What is written within a `with` block is kept in place of being shown."""
        return self.console.capture()


out, err = Stream(), Stream(stderr=True)


def print_json(content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Results for scripts, on standard output; what is not a finite number is null, which JSON has a word for."""
    typer.echo(json.dumps(finite(content), indent=2, allow_nan=False))


def finite(content: Any) -> Any:
    """The same with None for what is not a finite number."""
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
    """One line for one error."""
    from rich.text import Text

    text = Text("error: ", style="bold red").append(" ".join(message.split("\n")), style="not bold default")
    err.print(text, soft_wrap=True)


def show_problem(error: KinertiaError, of: str = "") -> None:
    """One line for every finding that stopped something, or for the error; `of` says whose it is, where several are."""
    for line in str(error).split("\n") if isinstance(error, BlockedError) else [str(error)]:
        show_error(f"{of}{line}")
    for k, line in enumerate(getattr(error, "__notes__", ())):
        err.print(f"{'then' if k else 'next'}: {line}", soft_wrap=True, markup=False, highlight=False)


@contextmanager
def shown_progress() -> Iterator[Callable[[str, float], None]]:
    """Progress of the stage at work: a bar with the time left on a terminal, a line per stage elsewhere.

    Yields a function that takes the stage's name and its share done. What has not been compiled on this machine is
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
        from kinertia.cli.progress_bar import shown_bar

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
    """First two columns to the left if the second has no heading, the numbers to the right."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=0)
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 or not heading else "right", overflow="fold")
    return table
