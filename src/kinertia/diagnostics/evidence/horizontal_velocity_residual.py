"""Compares the body's velocity with the force-derived one, as recorded and without a supposed fault."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.diagnostics.evidence.horizontal_velocity import ForceVelocity, joined_without_trend
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import FloatArray

HORIZONTAL = (0, 2)
"""Ground axes X and Z."""
DISTINGUISHABLE = 0.5
"""Across the walk a foot pushes to one side all the time: with the wrong sign it looks like another zero. On nine
trials what is true leaves 0.1 to 0.66 of what the other would, in one walk 0.7 to 1.7."""
MOST_ZERO_N = 25.0
"""Plates whose zeros are wrong by more show it while they are unloaded."""
CLEARLY_BEST = Limit(0.85)
"""A fault is identified where undoing it leaves less than this share of what undoing any other leaves."""


@dataclass(frozen=True)
class Scaled:
    """Gain error of one plate, or of all (None): its reading is `factor` times the truth; residual (m/s) without it."""

    plate: int | None
    factor: float
    residual: float


@dataclass(frozen=True, eq=False)
class VelocityResidual:
    """RMS difference (m/s) along one axis between the force-derived and the body's velocity, as recorded and with each
    supposed fault undone.

    Attributes:
        as_read: residual of the forces as recorded.
        all_reversed: residual if all plates have the wrong sign.
        without_trend: residual if all plates have the same zero offset.
        plate_reversed, plate_zeroed: (p,) residuals if one plate has the wrong sign, or a zero offset.
        zero_offset_n: (p,) N, that zero offset.
        all_zeroed: residual if every plate has a zero offset of its own; as read where one would exceed `MOST_ZERO_N`.
        scaled: residuals if all plates, or one, have a gain error.
    """

    as_read: float
    all_reversed: float
    without_trend: float
    plate_reversed: FloatArray
    plate_zeroed: FloatArray
    zero_offset_n: FloatArray
    all_zeroed: float
    scaled: tuple[Scaled, ...]

    @classmethod
    def of(cls, time: FloatArray, force: FloatArray, parts: Sequence[ForceVelocity], axis: int) -> Self:
        """Compute the residuals along X (0) or Z (2), of forces (k, p, 3) N of plates or feet over (k,) s."""
        body = _centred([(part.pelvis[:, axis] + part.centre[:, axis]) / 2 for part in parts])
        by_forces = _centred([part.by_forces[:, axis] for part in parts])
        off = by_forces - body
        reversed_, zeroed, zero_offset_n, scaled = [], [], [], [_scaled(None, off, by_forces)]
        newtons = []
        for p, own_force in enumerate(np.moveaxis(force, 1, 0)):
            own, one_newton = (
                _centred([part.by(time, each) for part in parts])
                for each in (own_force[:, axis], (own_force[:, 1] > 0.0).astype(float))
            )
            newtons.append(one_newton)
            zero_offset_n.append(float(one_newton @ off) / max(float(one_newton @ one_newton), 1e-12))
            scaled.append(_scaled(p, off, own))
            reversed_.append(np.std(off - 2.0 * own))
            zeroed.append(np.std(off - zero_offset_n[-1] * one_newton))
        trends = joined_without_trend(parts, [part.by_forces[:, axis] - part.centre[:, axis] for part in parts])
        return cls(
            float(np.std(off)),
            float(np.std(by_forces + body)),
            float(np.std(trends)),
            np.array(reversed_),
            np.array(zeroed),
            np.array(zero_offset_n),
            _all_zeroed(off, np.column_stack(newtons)),
            tuple(scaled),
        )

    def evidence(self, residual: float, limit: float) -> Quantity:
        """Return the residuals before and after a fault is undone, as evidence, with their `limit`."""
        return Quantity((self.as_read, residual), "m/s", limit=limit)


def steady_scaled(
    time: FloatArray, force: FloatArray, parts: Sequence[ForceVelocity], axis: int
) -> tuple[float, tuple[Scaled, ...]]:
    """Compute residuals without the linear trend that zero offsets cause: the residual (m/s) of forces as recorded, and
    if all plates, or one, have a gain error. Arguments as of `VelocityResidual.of`.
    """
    by_forces = [part.by_forces[:, axis] for part in parts]
    moved = [(part.pelvis[:, axis] + part.centre[:, axis]) / 2 for part in parts]
    off = joined_without_trend(parts, by_forces) - joined_without_trend(parts, moved)
    by_plate = [[part.by(time, own) for part in parts] for own in force[..., axis].T]
    plates = [None, *range(len(by_plate))]
    each = zip(plates, [by_forces, *by_plate], strict=True)
    return float(np.std(off)), tuple(_scaled(plate, off, joined_without_trend(parts, own)) for plate, own in each)


def rotated_residual(parts: Sequence[ForceVelocity], angle: float) -> float:
    """Compute the residual (m/s) of both horizontal axes, forces rotated back by `angle` (rad) about the vertical."""
    # from Z to X is a positive rotation about Y
    by_forces, pelvis, centre = (
        _centred([getattr(part, name)[:, 2] + 1j * getattr(part, name)[:, 0] for part in parts])
        for name in ("by_forces", "pelvis", "centre")
    )
    return float(np.sqrt(np.mean(np.square(np.abs(by_forces * np.exp(-1j * angle) - (pelvis + centre) / 2)))))


def misread_plate_residuals(time: FloatArray, force: FloatArray, parts: Sequence[ForceVelocity]) -> FloatArray:
    """Compute the residuals (p, r) m/s of both horizontal axes if one plate's axes are rotated or exchanged.

    Args:
        time, force: (k,) s and (k, p, 3) N of plates.
        parts: windows of the trial.

    Returns:
        per plate the residual if its axes are exchanged with either sign, or rotated by 90 degrees either way.
    """
    body, by_forces = (
        _centred([each[:, 2] + 1j * each[:, 0] for each in of_parts])
        for of_parts in ([(part.pelvis + part.centre) / 2 for part in parts], [part.by_forces for part in parts])
    )
    residuals = []
    for own_force in np.moveaxis(force, 1, 0):
        own = _centred([part.by(time, own_force[:, 2]) + 1j * part.by(time, own_force[:, 0]) for part in parts])
        true = (1j * own.conj(), -1j * own.conj(), 1j * own, -1j * own)
        residuals.append([np.sqrt(np.mean(np.square(np.abs(by_forces - body - own + each)))) for each in true])
    return np.array(residuals)


def _all_zeroed(off: FloatArray, newtons: FloatArray) -> float:
    """Return the residual (m/s) of velocities (n,) without zero offsets of the plates, by what one newton of each does
    (n, p)."""
    zeros_n = np.linalg.lstsq(newtons, off, rcond=None)[0]
    possible = np.abs(zeros_n).max(initial=0.0) <= MOST_ZERO_N
    return float(np.std(off - newtons @ zeros_n if possible else off))


def _scaled(plate: int | None, off: FloatArray, own: FloatArray) -> Scaled:
    share = float(own @ off) / max(float(own @ own), 1e-12)
    return Scaled(plate, 1.0 / (1.0 - share) if share < 1.0 else np.inf, float(np.std(off - share * own)))


def _centred(windows: Sequence[np.ndarray]) -> np.ndarray:
    """Concatenate the windows, each less its mean."""
    return np.concatenate([each - each.mean() for each in windows])
