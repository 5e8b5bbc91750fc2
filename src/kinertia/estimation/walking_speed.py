"""Compares walking speed between two conditions or sessions: moments change with it."""

from collections.abc import Sequence

import numpy as np
from scipy import stats

from kinertia.estimation.condition_changes import SOURCES, Change
from kinertia.estimation.cycles import spatiotemporal_columns
from kinertia.estimation.trial_fit import TrialFit

_SHORTEST_S = 0.8
"""Of a walk without a whole stride whose pelvis shows its speed: most of a stride, in which speed varies by 10 %."""
_STANDING_M_S = 0.2
"""Speed of a pelvis below which the walk is on a treadmill, or none."""
NOTABLE = 0.05
"""Relative difference of speed that is pointed out even where it is not shown to be one, chosen here."""


def speed_change(before: Sequence[TrialFit], after: Sequence[TrialFit]) -> Change | None:
    """Compare walking speed, with each walk counted once (strides of one walk are alike); None where it is not known.

    One walk against one on a treadmill counts strides instead.
    """
    known = [[own for trial in trials if (own := _speeds(trial)).size] for trials in (before, after)]
    if not all(known):
        return None
    alone = min(map(len, known)) < 2
    values = [np.concatenate(each) if alone else np.array([own.mean() for own in each]) for each in known]
    means = [float(each.mean()) for each in values]
    counts = [len(each) for each in values]
    squares = [float(np.var(each, ddof=1)) / len(each) if len(each) > 1 else np.nan for each in values]
    sd = float(np.sqrt(sum(squares)))
    freedom = sum(squares) ** 2 / max(sum(s**2 / max(n - 1, 1) for s, n in zip(squares, counts, strict=True)), 1e-300)
    of_sd = stats.t(max(freedom, 1.0)) if np.isfinite(freedom) else None
    return Change(
        quantity="gait",
        joint="walking",
        component="speed",
        side="",
        event="",
        unit="m/s",
        before=means[0],
        after=means[1],
        strides=(counts[0], counts[1]),
        sd=sd,
        sd_by_source={source: sd if source == "stride" else 0.0 for source in SOURCES},
        mdc95=np.nan if of_sd is None else float(of_sd.ppf(0.975)) * sd,
        p=np.nan if of_sd is None else float(2.0 * of_sd.sf(abs(means[1] - means[0]) / max(sd, 1e-300))),
    )


def _speeds(trial: TrialFit) -> np.ndarray:
    """Return the speed of each stride, m/s; without strides that of the pelvis; empty where neither shows it."""
    all_strides = np.array(spatiotemporal_columns([trial])["speed_m_s"], dtype=float)
    strides: np.ndarray = all_strides[np.isfinite(all_strides)]
    if strides.size or trial.kinematics.trial.belt is not None or trial.course is None:
        return strides
    time = trial.kinematics.course_time
    lasted = float(time[-1] - time[0])
    if lasted < _SHORTEST_S:
        return strides
    first, last = trial.skeleton.root.centre(trial.course[[0, -1]])[:, [0, 2]]
    speed = float(np.linalg.norm(last - first)) / lasted
    return np.array([speed] if speed > _STANDING_M_S else [])
