"""Stores a compiled function as machine code alone.

Numba also stores what other functions, compiled later, would need to inline it: as much again, which takes longer to
load than the machine code. Only Python calls the functions stored here.
"""

from typing import Any

from llvmlite import binding as llvm
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.runtime import rtsys


class _MachineCode(CompileResultCacheImpl):  # type: ignore[misc]
    """Serialised form of a compiled function."""

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
