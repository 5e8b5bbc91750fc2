"""Suggests the next commands where a fit was refused because no marker set fits."""

from pathlib import Path

from kinertia.errors import KinertiaError, findings_of
from kinertia.io.subject.provenance import command_line
from kinertia.io.subject.tables import Model

_NO_MARKER_SET = {"L101", "L105"}
_DRAFT = "markers.toml"


def next_commands(error: KinertiaError, given: Path, model: Model, command: str) -> list[str]:
    """List the next commands in order; empty where another marker set would not help, or one was stated.

    Args:
        error: the reason why there is no fit.
        given: the subject file, its folder, or the markers of a trial.
        model: the model as stated in the subject file, or in options.
        command: the command that failed.
    """
    if not _NO_MARKER_SET & {one.code for one in findings_of(error)}:
        return []
    if model.static is None or model.markers is not None or model.osim is not None:
        return []
    folder = given if given.is_dir() else given.parent
    by_file = given.is_dir() or given.suffix.lower() == ".toml"
    drafted = folder / _DRAFT if by_file else Path(_DRAFT)
    draft = command_line(["kinertia", "markers", _as_typed(model.static), "-o", str(drafted)])
    if by_file:
        return [draft, f'put markers = "{_DRAFT}" under [model] of the subject file', command]
    return [draft, f"{command} --markers {_DRAFT}"]


def _as_typed(path: Path) -> str:
    """Return the path relative to the shell's folder where it is in it."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)
