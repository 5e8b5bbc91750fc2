"""What all commands share on a terminal: results on one stream, progress and errors on the other, plain tables."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import typer
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, Task, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from kinertia.checks.verdict import Verdict
from kinertia.cli.compiling import compile_once

# names of files and trials may contain what rich takes for markup
out = Console(markup=False, emoji=False, highlight=False)
err = Console(markup=False, emoji=False, highlight=False, stderr=True)
_COLOURS = {"pass": "green", "caution": "yellow", "fail": "bold red"}


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
    text = Text("error: ", style="bold red").append(" ".join(message.split("\n")), style="not bold default")
    err.print(text, soft_wrap=True)


def show_warning(sentence: str) -> None:
    """One of a result's, on standard output."""
    out.print(Text("warning: ", style="bold yellow").append(sentence, style="not bold default"))


def show_verdicts(verdicts: Iterable[Verdict]) -> None:
    """One paragraph each, the level first."""
    for level, sentence in verdicts:
        out.print(Text(f"{level}: ", style=_COLOURS[level]).append(sentence, style="not bold default"))


class _TimeLeftColumn(TimeRemainingColumn):
    """The time left, said to be that; nothing as long as nobody knows."""

    def render(self, task: Task) -> Text:
        return super().render(task).append(" left") if task.time_remaining else Text()


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
    seen: list[str] = []
    if out.quiet:
        yield lambda stage, share: None
        return
    if not err.is_terminal:

        def line(stage: str, share: float) -> None:
            if stage not in seen:
                seen.append(stage)
                err.print(stage)

        yield line
        return
    columns = (TextColumn("{task.description:>20}"), BarColumn(), TimeElapsedColumn(), _TimeLeftColumn())
    with Progress(*columns, console=err, transient=True) as bar:

        def move(stage: str, share: float) -> None:
            if seen[-1:] != [stage]:
                seen.append(stage)
                for task in bar.task_ids:
                    bar.remove_task(task)
                bar.add_task(stage, total=None)  # a task of its own, or the time left would be that of all stages
            if share > 0:
                bar.update(bar.task_ids[-1], total=1.0, completed=share)

        yield move


def plain_table(*headings: str) -> Table:
    """First two columns to the left if the second has no heading, the numbers to the right."""
    table = Table(box=box.SIMPLE_HEAD, padding=0)
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 or not heading else "right", overflow="fold")
    return table
