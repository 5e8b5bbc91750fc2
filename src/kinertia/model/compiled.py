"""Compiles functions to machine code by Numba, once per machine: `kinertia warm-up`, or the first run.

Functions over the frames of a trial are compiled, and stored in a folder whose name is a hash of their sources, of the
processor and of what compiles them: if a line of a compiled function changes, they are compiled again, and code of
older lines never runs. The folder is beside this file or, if that is not writable, in the user's cache; if neither is,
in the folder for temporary files. A copy goes to the user's cache, where other environments with the same sources find
it.

Numba also stores what other functions, compiled later, would need to inline it: as much again, which takes longer to
load than the machine code. Only Python calls the functions stored here.

The digit is the number of dimensions. Strided arrays may be parts of larger ones; all others are contiguous.
"""

import hashlib
import shutil
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from itertools import product
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import llvmlite
import numba
import numpy as np
import platformdirs
from llvmlite import binding as llvm
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.runtime import rtsys

F = TypeVar("F", bound=Callable[..., Any])
_COMPLETE = "complete"
"""File that marks a complete folder."""
_KEPT = 5
"""Number of folders that are kept in a place: the newest."""
SOURCES = (
    "model/compiled.py",
    "model/kinematic_tree.py",
    "motion/rigid_body.py",
    "motion/dynamics.py",
    "estimation/simultaneous/terms/root_equations.py",
    "motion/marker_sums.py",
    "motion/ground_reactions.py",
    "estimation/simultaneous/instruments/plates.py",
    "estimation/simultaneous/uncertainty/joint_rows.py",
    "estimation/simultaneous/uncertainty/curve_variances.py",
    "estimation/simultaneous/linear_algebra/block_tridiagonal.py",
    "estimation/simultaneous/linear_algebra/normal_equations.py",
    "estimation/simultaneous/linear_algebra/elimination.py",
    "estimation/simultaneous/terms/root_terms.py",
    "estimation/simultaneous/markers/marker_errors.py",
    "estimation/simultaneous/terms/marker_terms.py",
)
"""Files of the package with compiled functions, which call one another."""


def compiled(function: F) -> F:
    """Compile a function to machine code, which is stored; only Python may call it.

    Division by zero gives inf or nan, as in NumPy.
    """
    return _stored(function)


def compiled_sums(function: F) -> F:
    """Compile as `compiled` does, with sums in whatever order is fastest: on another processor they round otherwise."""
    return _stored(function, fastmath={"reassoc", "contract"})


def _stored(function: F, **options: Any) -> F:
    result: Any = _compiled(function, **options)
    result._cache = MachineCodeCache(function)
    return cast(F, result)


def part(function: F) -> F:
    """Compile a function that only compiled ones call, whose machine code is stored with theirs.

    A wrapper for Python would take longer to compile than many of these functions.
    """
    return _compiled(function, no_cpython_wrapper=True)


def inlined(function: F) -> F:
    """Compile as `part` does a small function of inner loops, with its code inserted where it is called."""
    return _compiled(function, no_cpython_wrapper=True, forceinline=True)


def is_stored(value: Any, module: str) -> bool:
    """Return whether a value is a function of this module whose machine code is stored."""
    from numba.core.registry import CPUDispatcher

    defined_here = isinstance(value, CPUDispatcher) and value.__module__ == module
    return defined_here and not value.targetoptions.get("no_cpython_wrapper")


def _compiled(function: F, **options: Any) -> F:
    result: F = numba.njit(error_model="numpy", nogil=True, no_cfunc_wrapper=True, **options)(function)
    return result


@cache
def cache_folder() -> Path:
    """Return the folder of compiled functions: a separate one for every state of their sources and of what compiles."""
    package = Path(__file__).parents[1]
    compiler = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, llvm.get_host_cpu_name())
    text = hashlib.sha256(" ".join(compiler).encode())
    for name in SOURCES:
        text.update((package / name).read_bytes())
    name = f"kinertia-{text.hexdigest()[:16]}"
    beside = Path(__file__).parent / "__pycache__"
    places = [place / name for place in (beside, _user_cache(), Path(tempfile.gettempdir()))]
    complete = (place for place in places if (place / _COMPLETE).exists())
    return next(complete, None) or next((place for place in places if _writable(place)), places[-1])


def is_compiled() -> bool:
    """Return whether everything has been compiled on this machine, in the present state of the sources."""
    return (cache_folder() / _COMPLETE).exists()


def set_compiled() -> None:
    """Record that everything has been compiled, copy it to the user's cache, and delete all but the newest folders."""
    folder = cache_folder()
    shared = _user_cache() / folder.name
    with suppress(OSError):
        (folder / _COMPLETE).touch()
        if not (shared / _COMPLETE).exists():
            shutil.copytree(folder, shared, ignore=shutil.ignore_patterns(_COMPLETE), dirs_exist_ok=True)
            (shared / _COMPLETE).touch()
        for place in (folder.parent, shared.parent):
            for older in sorted(place.glob("kinertia-*/"), key=lambda path: path.stat().st_mtime)[:-_KEPT]:
                shutil.rmtree(older, ignore_errors=True)


def _user_cache() -> Path:
    return platformdirs.user_cache_path("kinertia", appauthor=False)


def _writable(folder: Path) -> bool:
    """Return whether functions can be stored there, by trying, since permissions are not conclusive."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


class _InFolder:
    """Tells Numba that a function is kept in `cache_folder`, whose name stands for its source.

    Args:
        line: of the function in its file.
    """

    def __init__(self, line: int) -> None:
        self.line = line

    @classmethod
    def from_function(cls, function: Callable[..., Any], _file: str) -> "_InFolder":
        return cls(function.__code__.co_firstlineno)

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def ensure_cache_path(self) -> None:
        cache_folder().mkdir(parents=True, exist_ok=True)

    def get_source_stamp(self) -> str:
        return ""

    def get_disambiguator(self) -> str:
        return str(self.line)


class _MachineCode(CompileResultCacheImpl):  # type: ignore[misc]
    """Serialised form of a compiled function."""

    _locator_classes = (_InFolder,)

    def reduce(self, result: Any) -> tuple[Any, ...]:
        """Serialise as Numba does, but with only the name by which Python calls the code, and without what nobody looks
        up: types of all variables, and modules of functions that need no constants from there.
        """
        (name, kind, (code, _)), *others, places = super().reduce(result._replace(type_annotation=""))
        called = llvm.parse_assembly(f'define void @"{result.fndesc.llvm_cpython_wrapper_name}"() {{ ret void }}')
        needed = tuple(place for place in places if place.consts)
        return ((name, kind, (code, called.as_bitcode())), *others, needed)


class MachineCodeCache(FunctionCache):  # type: ignore[misc]
    """Cache files of one function that Python calls."""

    _impl_class = _MachineCode

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Load as Numba does, without registering all that Numba can compile, which takes longer than loading code."""
        rtsys.initialize(target)
        with self._guard_against_spurious_io_errors():
            kept = self._load_overload(signature, target)
            if kept is not None:
                return kept
        return super().load_overload(signature, target)


class _Form(NamedTuple):
    """Element type, number of dimensions, and whether elements lie side by side."""

    element: type
    dimensions: int
    contiguous: bool = True

    def example(self) -> np.ndarray:
        """Return an array of this form."""
        wide: np.ndarray = np.empty((4,) * self.dimensions, self.element)
        return wide if self.contiguous else wide[(slice(None, None, 2),) * self.dimensions]


Float1 = Annotated[np.ndarray, _Form(np.float64, 1)]
Float2 = Annotated[np.ndarray, _Form(np.float64, 2)]
Float3 = Annotated[np.ndarray, _Form(np.float64, 3)]
Float4 = Annotated[np.ndarray, _Form(np.float64, 4)]
Single2 = Annotated[np.ndarray, _Form(np.float32, 2)]
Single3 = Annotated[np.ndarray, _Form(np.float32, 3)]
Single4 = Annotated[np.ndarray, _Form(np.float32, 4)]
Int1 = Annotated[np.ndarray, _Form(np.int64, 1)]
Int2 = Annotated[np.ndarray, _Form(np.int64, 2)]
Bool1 = Annotated[np.ndarray, _Form(np.bool_, 1)]
Bool2 = Annotated[np.ndarray, _Form(np.bool_, 2)]
StridedFloat2 = Annotated[np.ndarray, _Form(np.float64, 2, contiguous=False)]
StridedFloat3 = Annotated[np.ndarray, _Form(np.float64, 3, contiguous=False)]


def argument_types(function: Callable[..., Any]) -> list[tuple[Any, ...]]:
    """Return Numba's types of a function's arguments, from its annotations; several where one may be this or that."""
    from numba import typeof  # imported here so that what only names types does not load it

    hints = get_type_hints(function, include_extras=True)
    either = [
        get_args(hint) if get_origin(hint) is Union else (hint,) for name, hint in hints.items() if name != "return"
    ]
    return [tuple(typeof(_example(hint)) for hint in chosen) for chosen in product(*either)]


def _example(hint: Any) -> Any:
    """Return a value of an annotated type: an array, a number, or a tuple of these, named or not."""
    if get_origin(hint) is Annotated:
        return get_args(hint)[1].example()
    if get_origin(hint) is tuple:
        return tuple(map(_example, get_args(hint)))
    if fields := getattr(hint, "_fields", ()):
        hints = get_type_hints(hint, include_extras=True)
        return hint(*(_example(hints[name]) for name in fields))
    return hint()
