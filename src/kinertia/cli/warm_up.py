"""Defines `kinertia warm-up`: compiles beforehand what the first fit would compile."""

from kinertia.cli.common import Outcome, Quiet, out, shown_progress
from kinertia.model.compiled import cache_folder, is_compiled


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
