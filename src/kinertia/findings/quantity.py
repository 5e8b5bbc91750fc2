"""Defines a measured quantity in SI units, the limits of checks that it is compared with, and where it was found."""

from dataclasses import dataclass
from typing import Any, Final


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
            name: list(entry) if isinstance(entry, tuple) else entry
            for name, entry in others.items()
            if entry is not None
        }


class Limit(float):
    """A limit of a check: a number like any other, which the texts of the catalogue show with its unit.

    It is stated once, beside the function that applies it; `diagnostics/check` says how texts refer to it.

    Attributes:
        unit: SI unit, "1" for shares and counts.
        usual: range on recordings without faults; None where it is not known.
        source: publication that it is from; what was measured for it is said below the constant.

    Examples:
        >>> from kinertia.findings.quantity import Limit
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


@dataclass(frozen=True)
class Where:
    """Where something was found; what is None, or empty, means all of it.

    Attributes:
        file, line: of text files, the one-based line.
        trial: name of the trial, or of the static trial.
        plate: name of the force plate.
        axis: direction of the person's walk: "fore-aft", "vertical" or "mediolateral".
        file_axis: the same axis in the file, "X", "Y" or "Z".
        markers: labels.
        part: segment, joint, coordinate or parameter.
        span_s: start and end, s.

    Examples:
        >>> kinertia.Where(trial="walk", plate="plate 1").overlaps(kinertia.Where(trial="walk"))
        True
    """

    file: str | None = None
    line: int | None = None
    trial: str | None = None
    plate: str | None = None
    axis: str | None = None
    file_axis: str | None = None
    markers: tuple[str, ...] = ()
    part: str | None = None
    span_s: tuple[float, float] | None = None

    def overlaps(self, other: "Where") -> bool:
        """Return whether both may concern the same: equal or unstated in each respect, with common marker and time."""
        for name in ("trial", "plate", "axis", "part"):
            mine, others = getattr(self, name), getattr(other, name)
            if mine is not None and others is not None and mine != others:
                return False
        if self.markers and other.markers and not set(self.markers) & set(other.markers):
            return False
        if self.span_s is None or other.span_s is None:
            return True
        return self.span_s[0] <= other.span_s[1] and other.span_s[0] <= self.span_s[1]

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON content: what is stated."""
        stated = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in stated.items()
            if value not in (None, ())
        }
