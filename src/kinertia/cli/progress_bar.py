"""Draws the progress bar of a terminal, with the time left."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, Task, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text


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
