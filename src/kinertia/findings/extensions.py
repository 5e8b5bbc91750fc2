"""Finds what is loaded by name: what other packages add by entry points (marker sets, readers, rules), and the report.

| group | name of the entry point | object |
|---|---|---|
| `kinertia.marker_sets` | name of the preset | path of a TOML file, as `io/marker_sets` has them |
| `kinertia.readers` | ending of the files without its dot | function that takes a path and returns a `Recording` |
| `kinertia.rules` | a letter that no family of the catalogue has | a `RulePackage` |

An object is loaded when it is needed. Names that Kinertia has itself stay its own. `examples/plugin` has one of each.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

MARKER_SETS, READERS, RULES = "kinertia.marker_sets", "kinertia.readers", "kinertia.rules"
_SHOWN_BY = "kinertia.report.display"


class ExtensionError(Exception):
    """An installed package that extends Kinertia cannot be loaded."""


@dataclass(frozen=True)
class RulePackage:
    """Rules of another package: a family of the catalogue, and the questions that its codes answer.

    Attributes:
        catalogue: TOML file with `title`, `[questions]` and a table per code, as `findings/catalogue` has them.
        recording_questions: for each question its three characters and a function that takes a recording's context
            (`context.recording`, `context.name`) and yields findings; asked of every motion.

    Examples:
        >>> from pathlib import Path
        >>> rules = kinertia.RulePackage(Path("catalogue.toml"), {"X10": lambda context: ()})
        >>> list(rules.recording_questions)
        ['X10']
    """

    catalogue: Path
    recording_questions: dict[str, Callable[[Any], Any]]


def names(group: str) -> tuple[str, ...]:
    """Return the names that installed packages have in a group, in alphabetical order."""
    return tuple(sorted(_points(group)))


@cache
def loaded(group: str, name: str) -> Any:
    """Load the object of a name.

    Raises:
        KeyError: no package has that name.
        ExtensionError: its package cannot be loaded.
    """
    point = _points(group)[name]
    try:
        return point.load()
    except Exception as error:
        package = point.dist.name if point.dist is not None else point.module
        problem = f"{group} {name!r} of the installed package {package} cannot be loaded ({error!r}); uninstall it"
        raise ExtensionError(problem) from error


@cache
def _points(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=group)}


def report_function(name: str) -> Callable[..., Any]:
    """Return the function of this name that shows or saves data."""
    function: Callable[..., Any] = getattr(import_module(_SHOWN_BY), name)
    return function
