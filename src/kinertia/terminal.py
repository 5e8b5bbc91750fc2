"""What all commands share on a terminal: results on one stream, progress and errors on the other, plain tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

# names of files and trials may contain what rich takes for markup
out = Console(markup=False, emoji=False, highlight=False)
err = Console(markup=False, emoji=False, highlight=False, stderr=True)


@contextmanager
def shown_progress() -> Iterator[Callable[[str, float], None]]:
    """A progress bar on a terminal, a line per stage elsewhere; takes the stage's name and its share done."""
    if not err.is_terminal:
        seen: list[str] = []

        def line(stage: str, share: float) -> None:
            if stage not in seen:
                seen.append(stage)
                err.print(stage)

        yield line
        return
    columns = (TextColumn("{task.description:>20}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda stage, share: bar.update(task, description=stage, completed=share)


def plain_table(*headings: str) -> Table:
    """First two columns to the left if the second has no heading, the numbers to the right."""
    table = Table(box=box.SIMPLE_HEAD, padding=0)
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 or not heading else "right", overflow="fold")
    return table
