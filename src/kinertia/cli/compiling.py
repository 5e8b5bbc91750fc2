"""Compiles the numerical core once per machine, before the first command that computes.

As many processes as there are cores share its functions, by length. LLVM's first level of optimisation is enough for
them and takes less time than the third.
"""

import gc
import math
import os
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from typing import Any

from kinertia.io.file_names import PYTHON
from kinertia.model.compiled import SOURCES, is_compiled, is_stored, set_compiled

_STAGE = "compiling, once"
_LONGER = (1.0, 1.02, 1.04, 1.06, 1.1, 1.15, 1.2)
"""Lengths of a share to try, over that if nothing were compiled twice."""


def compile_once(progress: Callable[[str, float], None]) -> None:
    """Compile everything not yet compiled on this machine."""
    if is_compiled():
        return
    progress(_STAGE, 0.0)
    from kinertia.motion.workload import cores

    # Numba reads it when it compiles, here and in the processes beside
    os.environ.setdefault("NUMBA_OPT", "1")
    count = cores()
    with _beside(count):
        for done in _compiled(shares(stored_functions(), count)[0]):
            progress(_STAGE, done)
    # loads what the others compiled, and compiles what they left, as where no process can be started
    for _ in _compiled(stored_functions()):
        pass
    progress(_STAGE, 1.0)
    set_compiled()


def stored_functions() -> list[Any]:
    """Return all functions whose machine code is stored, the longest first."""
    modules = [import_module("kinertia." + name.removesuffix(".py").replace("/", ".")) for name in SOURCES]
    functions = [value for module in modules for value in vars(module).values() if is_stored(value, module.__name__)]
    return sorted(functions, key=_length, reverse=True)


@contextmanager
def _beside(count: int) -> Iterator[None]:
    """Compile all shares but the first in processes beside this one, until the end of the block at the earliest."""
    beside: list[subprocess.Popen[bytes]] = []
    try:
        with suppress(OSError):
            for k in range(1, count):
                command = [*PYTHON, "-c", f"from {__name__} import compile_share as c; c({k}, {count})"]
                beside.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        yield
        for process in beside:
            process.wait()
    finally:
        for process in beside:
            process.kill()
            process.wait()


def compile_share(k: int, count: int) -> None:
    """Compile share k of `count`."""
    for _ in _compiled(shares(stored_functions(), count)[k]):
        pass


def shares(functions: Sequence[Any], count: int) -> list[list[Any]]:
    """Share functions among so many processes so that the longest share is short: what calls the same together."""
    divided = [_divided(functions, count, longer) for longer in _LONGER]
    return min(divided, key=lambda shared: max(_length(*share) for share in shared))


def _divided(functions: Sequence[Any], count: int, longer: float) -> list[list[Any]]:
    """Share functions among so many processes: each goes to the share that then has least more to compile.

    A share has room for so many times what it would have if nothing were compiled twice. What no share has room for
    goes to the one that is then shortest.
    """
    result: list[list[Any]] = [[] for _ in range(count)]
    room = longer * _length(*functions) / count
    for function in functions:
        lengths = [(_length(*share), _length(*share, function)) for share in result]
        costs = [(after - before if after <= room else math.inf, after) for before, after in lengths]
        result[costs.index(min(costs))].append(function)
    return result


def _compiled(functions: Sequence[Any]) -> Iterator[float]:
    """Compile functions, or load what is stored of them; yield the share done after each."""
    from kinertia.model.compiled import argument_types

    gc.disable()  # compiling makes millions of lasting objects, and looking for garbage there takes a tenth of its time
    try:
        for done, function in enumerate(functions, start=1):
            for types in argument_types(function.py_func):
                function.compile(types)
            yield done / (len(functions) + 1)
    finally:
        gc.enable()


def _length(*functions: Any) -> int:
    """Return the length of the bytecode of functions and of all that they call, each counted once."""
    return sum(len(python.__code__.co_code) for python in frozenset().union(*map(_needed, functions)))


@cache
def _needed(function: Any) -> frozenset[Any]:
    """Return a function and all that it calls, as Python's."""
    parts = {function.py_func}
    waiting = list(parts)
    while waiting:
        python = waiting.pop()
        called = {getattr(python.__globals__.get(name), "py_func", None) for name in python.__code__.co_names}
        waiting += (new := called - parts - {None})
        parts |= new
    return frozenset(parts)
