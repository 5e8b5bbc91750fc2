"""Determines which part of stride and stance of each side has joint moments."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.curve_source import Estimated
from kinertia.motion.gait_cycle import PERCENT, Stride
from kinertia.trial.data import FEET
from kinertia.trial.sampled_time import runs

PUSH_OFF_SHARE = 0.75
"""Share of stance from which on the ankle pushes off."""
_WHOLE = 0.98
"""Share of a phase that counts as all of it: heel strike and toe off are known to some hundredths of a second."""


@dataclass(frozen=True)
class MomentExtent:
    """Part of a side's stride with joint moments, of the stride of which most of stance is known.

    Attributes:
        side: "r" or "l".
        stride_percent: first and last percent of the gait cycle of each interval.
        stance_share: share of stance that is known.
        push_off: whether the last quarter of stance is known.
        strides: number of strides of the side with all of stance.
    """

    side: str
    stride_percent: tuple[tuple[int, int], ...]
    stance_share: float
    push_off: bool
    strides: int

    @property
    def text(self) -> str:
        """In words: "left: 0 to 48 % of the stride, no push-off"."""
        word = {"r": "right", "l": "left"}[self.side]
        if not self.stride_percent:
            return f"{word}: none"
        parts = " and ".join(f"{first} to {last}" for first, last in self.stride_percent)
        if self.stance_share >= _WHOLE:
            return f"{word}: {parts} % of the stride, all of stance"
        missing = "" if self.push_off else ", no push-off"
        return f"{word}: {parts} % of the stride, {100 * self.stance_share:.0f} % of stance{missing}"


def moment_extents(trials: Sequence[Estimated]) -> tuple[MomentExtent, ...]:
    """Return the extent of the joint moments of each side that has strides; none after two-level."""
    result = []
    for side in FEET:
        own = [
            found
            for trial in trials
            for stride in trial.strides
            if stride.side == side and (found := _extent(trial, stride)) is not None
        ]
        if own:
            best = max(own, key=lambda one: (one.stance_share, sum(last - first for first, last in one.stride_percent)))
            whole = sum(one.stance_share >= _WHOLE for one in own)
            result.append(MomentExtent(side, best.stride_percent, best.stance_share, best.push_off, whole))
    return tuple(result)


def _extent(trial: Estimated, stride: Stride) -> MomentExtent | None:
    """Return the extent of one stride; None where no moments of that leg are computed."""
    curves = trial.joint_curves
    if curves is None or f"knee_{stride.side}" not in curves.joints["estimate"].joints:
        return None
    joints = curves.joints["estimate"]
    found = np.isfinite(joints.moments[:, joints.joints.index(f"knee_{stride.side}"), 0])
    known = np.interp(stride.time, curves.time, found.astype(float), left=0.0, right=0.0) > 1.0 - 1e-6
    toe_off = stride.percent(stride.toe_off_s)
    stance = toe_off >= PERCENT if np.isfinite(toe_off) else np.zeros(len(PERCENT), dtype=bool)
    late = stance & (PUSH_OFF_SHARE * toe_off <= PERCENT) if stance.any() else stance
    share = float(known[stance].mean()) if stance.any() else float("nan")
    pushes = bool(late.any() and known[late].mean() >= _WHOLE)
    return MomentExtent(stride.side, tuple((int(a), int(b)) for a, b in runs(known)), share, pushes, 1)
