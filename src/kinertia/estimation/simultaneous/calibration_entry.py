"""Defines `CalibrationEntry`: one calibrated quantity, as users read it in the table."""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from kinertia.findings.display import plate_text

POSITION, GAIN, FREE_MOMENT, ZERO, ROTATION, DELAY = (
    "position", "gain", "free moment", "zero offset", "rotation", "delay",
)  # fmt: skip
"""Quantities of instruments, each an error: recorded minus true; for a gain, recorded over true minus 1."""
CENTRE, AXIS, BENDING = "centre change", "axis change", "bending"
"""Quantities of the body. A change is the estimate minus the model's value."""
SHOWN_UNIT = {
    "m": (1e3, "mm"),
    "s": (1e3, "ms"),
    "1": (1e2, "%"),
    "N": (1.0, "N"),
    "N m": (1.0, "N m"),
    "rad": (180.0 / np.pi, "degrees"),
    "N m/N": (1e3, "N m/kN"),
    "kg m": (1.0, "kg m"),
}
"""Factor and unit in which a calibrated quantity is shown."""
INTERVAL_SD = 1.96
"""Half of a 95 % interval, in standard deviations."""
NOTABLE = 2.0


@dataclass(frozen=True, kw_only=True)
class CalibrationEntry:
    """Estimate of one calibrated quantity, in SI units.

    Attributes:
        kind: kind of instrument or body part.
        plate: name; None for all plates together, and if it is not a plate.
        joint: name.
        trial: name; None if all trials share the quantity.
        quantity: one of the constants of this module.
        axis: "x" forward, "y" up or "z" to the right; "1" or "2" of two directions across the axis of a joint.
        value: an error for instruments, a change for joints.
        prior_sd, sd: standard deviations before and after.
        unit: a key of SHOWN_UNIT.
        moved: for instruments, the effect of the uncorrected error on the most affected joint moment, in half-widths of
            the moment's own 95 % interval.
        contradicted_by: other estimate that finds another error of the instrument; None if there is none.

    >>> gain = CalibrationEntry(
    ...     kind="plate", plate="left", quantity=GAIN, value=-0.2, prior_sd=0.01, sd=0.01, unit="1", moved=3.0
    ... )
    >>> str(gain), gain.found, gain.supported
    ('plate left: gain', True, True)
    """

    kind: Literal["plate", "synchronisation", "joint", "trunk"]
    plate: str | None = None
    joint: str | None = None
    trial: str | None = None
    quantity: str
    axis: str | None = None
    value: float
    prior_sd: float
    sd: float
    unit: str
    moved: float | None = None
    contradicted_by: str | None = None

    @property
    def of_instrument(self) -> bool:
        """Whether it is an error of plates or synchronisation."""
        return self.kind in ("plate", "synchronisation")

    @property
    def key(self) -> tuple[str | None, ...]:
        """Identifier of the quantity among all entries of a fit."""
        return self.kind, self.plate, self.joint, self.trial, self.quantity, self.axis

    @property
    def notable(self) -> bool:
        """Whether the error exceeds two prior standard deviations."""
        return abs(self.value) > NOTABLE * self.prior_sd

    @property
    def found(self) -> bool:
        """Whether the error also exceeds two posterior standard deviations."""
        return self.notable and abs(self.value) > NOTABLE * self.sd

    @property
    def moves_moments(self) -> bool:
        """Whether the error exceeds two posterior standard deviations and affects joint moments beyond their bars."""
        return abs(self.value) > NOTABLE * self.sd and self.moved is not None and self.moved > 1.0

    @property
    def supported(self) -> bool:
        """Whether the error also affects joint moments and is contradicted by no other estimate."""
        return self.notable and self.moves_moments and not self.contradicted_by

    def __str__(self) -> str:
        of = item_text(self.kind, self.plate, self.joint)
        return f"{of}: {quantity_text(self.quantity, self.axis, self.trial)}"


def item_text(kind: str, plate: str | None, joint: str | None = None) -> str:
    """Return the label of what has a quantity: "plate left", "all plates", "hip_r", "synchronisation"."""
    return plate_text(plate) if kind == "plate" else joint or kind


def quantity_text(quantity: str, axis: str | None, trial: str | None = None) -> str:
    """Return the label of a quantity with its axis and, if specific to one, its trial: "position x", "gain in walk"."""
    along = f"{quantity} {axis}" if axis else quantity
    return f"{along} in {trial}" if trial else along


def calibration_columns(entries: Iterable[CalibrationEntry]) -> dict[str, list[Any]]:
    """Return the table of calibrated quantities, by column."""
    entries = list(entries)
    return {field.name: [getattr(one, field.name) for one in entries] for field in fields(CalibrationEntry)}
