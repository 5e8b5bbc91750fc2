"""Defines a limit of a check: a number in SI units with its unit, what is usual, and where it is from."""

from typing import Final


class Limit(float):
    """A limit of a check: a number like any other, which the texts of the catalogue show with its unit.

    It is stated once, beside the function that applies it; `diagnostics/check` says how texts refer to it.

    Attributes:
        unit: SI unit, "1" for shares and counts.
        usual: range on recordings without faults; None where it is not known.
        source: publication that it is from; what was measured for it is said below the constant.

    Examples:
        >>> from kinertia.findings.limit import Limit
        >>> step = Limit(7.5, "N", usual=(0.0, 4.9))
        >>> 8.0 > step, step / 2, step.unit, step.usual
        (True, 3.75, 'N', (0.0, 4.9))
    """

    __slots__ = ("source", "unit", "usual")

    unit: Final[str]
    usual: Final[tuple[float, float] | None]
    source: Final[str]

    def __new__(
        cls, value: float, unit: str = "1", usual: tuple[float, float] | None = None, source: str = ""
    ) -> "Limit":
        """Create the number; see the class for the arguments."""
        return super().__new__(cls, value)

    def __init__(
        self, value: float, unit: str = "1", usual: tuple[float, float] | None = None, source: str = ""
    ) -> None:
        self.unit, self.usual, self.source = unit, usual, source

    def __getnewargs__(self) -> tuple[float, str, tuple[float, float] | None, str]:  # type: ignore[override]
        return float(self), self.unit, self.usual, self.source
