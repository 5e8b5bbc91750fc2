"""Compiles functions to machine code by Numba, once per machine: `kinertia warm-up`, or the first run.

What runs over the frames of a trial is compiled, and kept in a folder that names its sources: whoever changes a line
of a compiled function, or installs another version, compiles anew and never runs what an older line gave. The folder
is beside this file or, where that cannot be written to, in the user's cache; if neither can, in the folder for
temporary files.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import platformdirs

F = TypeVar("F", bound=Callable[..., Any])

_COMPLETE = "complete"
"""File that says so."""
SOURCES = (
    "model/compiled.py",
    "model/kept_code.py",
    "model/spatial.py",
    "model/kinematic_tree.py",
    "motion/rigid_body.py",
    "motion/regressor.py",
    "motion/root_columns.py",
    "motion/marker_sums.py",
    "motion/load_splines.py",
    "estimation/simultaneous/plate_loads.py",
    "estimation/simultaneous/axis_columns.py",
    "estimation/simultaneous/normal_equations.py",
    "estimation/simultaneous/elimination.py",
    "estimation/simultaneous/root_gradient.py",
    "estimation/simultaneous/root_terms.py",
    "estimation/simultaneous/knot_interval.py",
    "estimation/simultaneous/seen_markers.py",
    "estimation/simultaneous/marker_gradient.py",
    "estimation/simultaneous/marker_terms.py",
)
"""Files of the package with compiled functions: those call one another."""


def compiled(function: F) -> F:
    """The function as machine code, which is kept; division by zero gives inf or nan, as NumPy has it. Only Python
    calls it.
    """
    from kinertia.model.kept_code import KeptCode  # brings numba

    result: Any = _compiled(function)
    with _kept_in(cache_folder()):
        result._cache = KeptCode(function)
    return cast(F, result)


def part(function: F) -> F:
    """As `compiled`, for functions that only compiled ones call, with whose code theirs is kept: to let Python call
    them takes longer to compile than many of them do.
    """
    return _compiled(function, no_cpython_wrapper=True)


def inlined(function: F) -> F:
    """As `part`, for small functions in inner loops: their code stands where they are called."""
    return _compiled(function, no_cpython_wrapper=True, forceinline=True)


def _compiled(function: F, **options: bool) -> F:
    import numba  # so that commands which compute nothing do not load it

    result: F = numba.njit(error_model="numpy", nogil=True, no_cfunc_wrapper=True, **options)(function)
    return result


@cache
def cache_folder() -> Path:
    """Where compiled functions are kept: a folder of its own for every state of their sources."""
    package = Path(__file__).parents[1]
    text = hashlib.sha256()
    for name in SOURCES:
        text.update((package / name).read_bytes())
    name = f"kinertia-{text.hexdigest()[:16]}"
    places = (Path(__file__).parent / "__pycache__", _user_cache(), Path(tempfile.gettempdir()))
    return next((place / name for place in places if _writable(place / name)), places[-1] / name)


def is_compiled() -> bool:
    """Whether everything has been compiled on this machine, in the present state of the sources."""
    return (cache_folder() / _COMPLETE).exists()


def set_compiled() -> None:
    """Note that everything has been compiled, and drop what earlier states of the sources left beside it."""
    folder = cache_folder()
    with suppress(OSError):
        (folder / _COMPLETE).touch()
        for other in folder.parent.glob("kinertia-*"):
            if other != folder and folder.parent.name == "__pycache__":
                shutil.rmtree(other, ignore_errors=True)


def _user_cache() -> Path:
    return platformdirs.user_cache_path("kinertia", appauthor=False)


def _writable(folder: Path) -> bool:
    """Whether functions can be kept there; tried, since permissions do not tell."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@contextmanager
def _kept_in(folder: Path) -> Iterator[None]:
    """Numba reads the folder while it decorates a function; other packages' functions stay where they are."""
    from numba.core import config

    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        yield
    finally:
        config.CACHE_DIR = before
