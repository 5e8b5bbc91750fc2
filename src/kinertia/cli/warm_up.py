"""`kinertia warm-up`: compile beforehand what the first fit would compile."""

from __future__ import annotations

from kinertia.cli.options import Quiet
from kinertia.cli.terminal import out, shown_progress
from kinertia.model.compiled import cache_folder, is_compiled


def warm_up(quiet: Quiet = False) -> None:
    """Compile beforehand what the first fit would compile.

    Kinertia's calculations are compiled once on a machine, which takes about
    half a minute. A command that computes does it when it must; an
    administrator can do it for all users of an installation that only he may
    write to, and a cluster before its jobs start.

    [bold]Example[/]

    kinertia warm-up
    """
    done = is_compiled()
    with shown_progress():
        pass
    out.print(f"{'compiled already' if done else 'compiled'}: {cache_folder()}", soft_wrap=True)
