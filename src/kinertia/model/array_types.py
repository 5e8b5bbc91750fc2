"""Names the types of the arrays that compiled functions take, so that these are compiled before anything calls them.

The digit is the number of dimensions. Strided arrays may be parts of larger ones; all others are contiguous.
"""

from collections.abc import Callable
from itertools import product
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np


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
