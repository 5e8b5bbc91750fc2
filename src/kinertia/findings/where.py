"""Defines where something was found: file, trial, plate, axis, markers, part of the body, time."""

from dataclasses import dataclass
from typing import Any


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
            own, others = getattr(self, name), getattr(other, name)
            if own is not None and others is not None and own != others:
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
