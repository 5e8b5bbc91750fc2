"""Keeps a compiled function as machine code alone.

Numba keeps with it what other functions that are compiled later would need to contain it: as much again, which takes
longer to load than the machine code does. Only Python calls what is kept here.
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding as llvm
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.runtime import rtsys


class _MachineCode(CompileResultCacheImpl):  # type: ignore[misc]
    """What is written of a compiled function."""

    def reduce(self, result: Any) -> tuple[Any, ...]:
        """As Numba has it, but of all that the code defines only the name by which Python calls it is told."""
        (name, kind, (code, _)), *others = super().reduce(result)
        called = llvm.parse_assembly(f'define void @"{result.fndesc.llvm_cpython_wrapper_name}"() {{ ret void }}')
        return ((name, kind, (code, called.as_bitcode())), *others)


class KeptCode(FunctionCache):  # type: ignore[misc]
    """The files of one function that Python calls."""

    _impl_class = _MachineCode

    def load_overload(self, signature: Any, target: Any) -> Any:
        """As Numba has it, but only what compiles gets to know all that Numba can compile: longer than to load code."""
        rtsys.initialize(target)
        with self._guard_against_spurious_io_errors():
            kept = self._load_overload(signature, target)
            if kept is not None:
                return kept
        return super().load_overload(signature, target)
