"""Defines a measured quantity in SI units, with the limit that it exceeds."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Quantity:
    """A measured quantity in SI units, with the limit that it exceeds.

    Attributes:
        value: a number, several, or text.
        unit: "m", "s", "N", "N m", "N m/N", "kg", "kg m2", "rad", "Hz" ...; "1" for shares and counts, "" for text.
        limit: limit beyond which the rule fires.
        usual: range on fault-free recordings.
        sd: standard deviation.

    Examples:
        >>> kinertia.Quantity(-23.1, "N", limit=15.0).value
        -23.1
    """

    value: float | tuple[float, ...] | str
    unit: str = ""
    limit: float | None = None
    usual: tuple[float, float] | None = None
    sd: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON content: value and unit, and the others where known."""
        others = {"limit": self.limit, "usual": self.usual, "sd": self.sd}
        value = list(self.value) if isinstance(self.value, tuple) else self.value
        return {"value": value, "unit": self.unit} | {
            name: list(each) if isinstance(each, tuple) else each for name, each in others.items() if each is not None
        }
