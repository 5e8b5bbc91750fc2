"""Shows and saves data by functions that are registered for their types; data know nothing of reports.

`kinertia.report.display_registration` registers them; it is loaded when something is first shown or saved, by the name
that the package's top has given with `shown_by`.
"""

from functools import singledispatch
from importlib import import_module
from pathlib import Path
from typing import Any

_modules: list[str] = []


def shown_by(module: str) -> None:
    """Set the module that registers how things are shown; it is loaded when first needed."""
    _modules.append(module)


@singledispatch
def html(thing: object) -> str:
    """Return the HTML that a notebook shows for `thing`.

    Raises:
        TypeError: nothing is registered for its type; the same holds for all functions here.
    """
    _load(html, thing)
    return html(thing)


@singledispatch
def pictures(thing: object) -> Any:
    """Return the figures of `thing`, one method for each."""
    _load(pictures, thing)
    return pictures(thing)


@singledispatch
def save(thing: object, folder: str | Path, force: bool = False) -> Path:
    """Write `thing` into a folder, with `force` even if it holds other files, and return the folder."""
    _load(save, thing)
    return save(thing, folder, force=force)


@singledispatch
def figure(thing: object, name: str, path: str | Path, trial: str | None = None) -> Path:
    """Draw one figure of `thing`, or of one of its trials, into a file, and return the file."""
    _load(figure, thing)
    return figure(thing, name, path, trial)


@singledispatch
def dataset(thing: object, kind: str, over: str) -> Any:
    """Return curves of `thing` as an xarray Dataset."""
    _load(dataset, thing)
    return dataset(thing, kind, over)


@singledispatch
def draws(thing: object, count: int, seed: int) -> Any:
    """Return posterior draws of `thing` as an xarray Dataset."""
    _load(draws, thing)
    return draws(thing, count, seed)


@singledispatch
def gait_profile(thing: object, norms: str | Path) -> Any:
    """Compute gait scores of `thing` against norms in a file."""
    _load(gait_profile, thing)
    return gait_profile(thing, norms)


def _load(function: Any, thing: object) -> None:
    for module in _modules:
        import_module(module)
    if function.dispatch(type(thing)) is function.dispatch(object):
        raise TypeError(f"nothing is registered for a {type(thing).__name__}")
