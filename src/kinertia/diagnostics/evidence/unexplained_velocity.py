"""How far the velocity that horizontal forces cause is from the body's, as read and without one of some mistakes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.evidence.caused_velocity import CausedVelocity, without_trend
from kinertia.trial.data import FloatArray

TOLD_APART = 0.5
"""Across the walk a foot pushes to one side all the time: with the wrong sign it looks like another zero. On nine
trials what is true leaves 0.1 to 0.66 of what the other would, in one walk 0.7 to 1.7."""


@dataclass(frozen=True)
class Scaled:
    """One plate, or all (None), that reads `factor` times what it should; m/s that are left without that."""

    plate: int | None
    factor: float
    left: float


@dataclass(frozen=True, eq=False)
class Unexplained:
    """m/s, along one axis: how far the velocity that the forces cause is from that of the body (RMS), as it is and by
    each of some mistakes.

    Attributes:
        as_read: none.
        all_turned: all plates have the wrong sign.
        without_trend: all plates have the same wrong zero.
        plate_turned, plate_zeroed: (p,) one plate has the wrong sign, or the wrong zero.
        zero_n: (p,) N, that zero.
        scaled: all plates have the same wrong gain, or one has it.
    """

    as_read: float
    all_turned: float
    without_trend: float
    plate_turned: FloatArray
    plate_zeroed: FloatArray
    zero_n: FloatArray
    scaled: tuple[Scaled, ...]

    @classmethod
    def of(cls, time: FloatArray, force: FloatArray, parts: Sequence[CausedVelocity], k: int) -> Unexplained:
        """Along X (0) or Z (2); forces (k, p, 3) N of plates, or of feet, over (k,) s."""
        body = _middled([(part.pelvis[:, k] + part.centre[:, k]) / 2 for part in parts])
        caused = _middled([part.caused[:, k] for part in parts])
        off = caused - body
        turned, zeroed, zero_n, scaled = [], [], [], [_scaled(None, off, caused)]
        for p, own_force in enumerate(np.moveaxis(force, 1, 0)):
            own, one_newton = (
                _middled([part.by(time, each) for part in parts])
                for each in (own_force[:, k], (own_force[:, 1] > 0.0).astype(float))
            )
            zero_n.append(float(one_newton @ off) / max(float(one_newton @ one_newton), 1e-12))
            scaled.append(_scaled(p, off, own))
            turned.append(np.std(off - 2.0 * own))
            zeroed.append(np.std(off - zero_n[-1] * one_newton))
        trends = np.concatenate([without_trend(part.time, part.caused[:, k] - part.centre[:, k]) for part in parts])
        return cls(
            float(np.std(off)),
            float(np.std(caused + body)),
            float(np.std(trends)),
            np.array(turned),
            np.array(zeroed),
            np.array(zero_n),
            tuple(scaled),
        )

    def or_zero(self, names: Sequence[str], zero: int, turned: float) -> str:
        """The other cause, where a zero of one plate accounts for as much."""
        if turned < TOLD_APART * self.plate_zeroed[zero]:
            return ""
        return (
            f"; or the zero of that axis of {names[zero]} is off by {self.zero_n[zero]:+.0f} N: without that it is "
            f"{self.plate_zeroed[zero]:.3f} m/s, and a foot that pushes to one side all the time does not tell which; "
            "see what the plate reads while nobody stands on it"
        )


def _scaled(plate: int | None, off: FloatArray, own: FloatArray) -> Scaled:
    share = float(own @ off) / max(float(own @ own), 1e-12)
    return Scaled(plate, 1.0 / (1.0 - share) if share < 1.0 else np.inf, float(np.std(off - share * own)))


def _middled(windows: Sequence[FloatArray]) -> FloatArray:
    """One after the other, each less its mean."""
    return np.concatenate([each - each.mean() for each in windows])
