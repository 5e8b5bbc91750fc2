"""M14, do loads still act along the feet once plates are corrected? If not, the body leans, and no plate is displaced.

Cameras that are tilted sideways displace the body relative to its loads, and so do displaced plates. The dynamics of
the whole body cannot distinguish the two; the feet can. On 31 recordings the loads of both feet, averaged, are within 7
mm of the lines from heel to toe. With plates displaced by 20 mm, on nine walks, they are 14 to 26 mm beside these
lines, and the correction moves them back; with cameras tilted by 1.5 degrees it moves them away.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.evidence.body_centre import owners_of
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory, foot_trajectories
from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import equal
from kinertia.estimation.simultaneous.calibration_entry import POSITION
from kinertia.estimation.trial_fit import TrialFit
from kinertia.findings.finding import Finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.trial.centre_of_pressure import FIRM_LOAD_N, centre_of_pressure
from kinertia.trial.data import FEET
from kinertia.trial.sampled_time import within

_ACROSS = "mediolateral"
_FARTHER_M = 0.008
_USUAL_M = (-0.007, 0.007)
_CENTRE_HEIGHT = 0.55
"""Height of the body's centre of mass over stature."""


def sideways_lean(context: ResultContext) -> Iterator[Finding]:
    """Report M145: an equal correction of all plates takes the loads away from both feet to one side."""
    across = [axis for axis in "xz" if context.along(axis, None).axis == _ACROSS]
    errors = [one for one in context.errors if one.quantity == POSITION and one.axis in across]
    if len(across) != 1 or not equal(errors):
        return
    beside = [found for trial in context.fit.trials if (found := _beside_feet_m(context, trial)) is not None]
    if not beside:
        return
    before, after = np.mean(np.abs(beside), axis=0)
    if after - before <= _FARTHER_M:
        return
    lean_m = float(np.mean([abs(corrected - recorded) for recorded, corrected in beside]))
    height_m = context.ready.subject.height_m
    evidence = {
        "lean_m": Quantity(lean_m, "m", usual=_USUAL_M),
        "beside_m": Quantity((float(before), float(after)), "m", limit=_FARTHER_M, usual=_USUAL_M),
    }
    if height_m is not None:
        evidence["tilt_rad"] = Quantity(lean_m / (_CENTRE_HEIGHT * height_m), "rad")
    yield with_evidence("M145", context.along(across[0], None), evidence)


def _beside_feet_m(context: ResultContext, trial: TrialFit) -> tuple[float, float] | None:
    """Return how far (m) the loads act to the right of the feet, both feet averaged, as recorded and as corrected; None
    where a foot or its loads are hardly visible.
    """
    recorded, markers = trial.kinematics.trial, trial.kinematics.trial.markers
    owners = owners_of(context.fit.skeleton)
    labels = {side: [one for one in markers.labels if owners.get(one) == f"foot_{side}"] for side in FEET}
    feet = foot_trajectories(markers, labels, recorded.belt) if all(labels.values()) else None
    if feet is None:
        return None
    time, loads = trial.reactions.time, recorded.loads
    used = within(loads.time, time[0], time[-1])
    before = _beside_m(feet, loads.time[used], loads.wrench[used])
    after = _beside_m(feet, time, trial.reactions.wrench)
    return None if np.isnan(before + after) else (before, after)


def _beside_m(feet: tuple[FootTrajectory, FootTrajectory], time: np.ndarray, wrench: np.ndarray) -> float:
    """Return how far (m) the loads (k, 2, 6) act to the right of the feet, each foot's mean weighted by its force."""
    beside = []
    for foot, trajectory in enumerate(feet):
        own = wrench[:, foot]
        firm = (own[:, 1] > FIRM_LOAD_N) & trajectory.seen(time)
        place = centre_of_pressure(own[firm])[:, [0, 2]]
        offset = trajectory.offset_m(time[firm], place)[:, 1]
        beside.append(float(own[firm, 1] @ offset / own[firm, 1].sum()) if firm.any() else np.nan)
    return float(np.mean(beside))
