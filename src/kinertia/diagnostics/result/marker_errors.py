"""M16 and M17, do markers stay where they were put? Reports markers that drift or moved, and joints corrected by
trials."""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.estimation.simultaneous.calibration_entry import AXIS, CalibrationEntry
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Skeleton
from kinertia.model.upper_body import head_markers

_MOVED_M = 0.03
"""Skin moves markers up to some 30 mm."""
_SHOULDER_M, _CLAVICLE_M = 0.12, 0.045
"""Markers so close to a shoulder joint move by as much more with the clavicle, while the arm is raised: its length
times 17 degrees."""
_DRIFTING = 3.0
"""Multiple of the usual SD from which a marker drifts, as in `marker_noise`."""
_BACKWARDS_RAD = 0.5
_TORSO_RAD = 0.25
_SIDES = {"r": "right", "l": "left"}


def moved_markers(context: ResultContext) -> Iterator[Finding]:
    """Report markers that drift in a trial, and markers displaced in one trial compared with every other."""
    posterior = context.fit.posterior
    if posterior is None:
        return
    loose, shoulders = _loose(context.fit.skeleton), _at_shoulders(context.fit.skeleton)
    for trial, noise in zip(context.fit.trials, posterior.marker_noise, strict=True):
        usual_m = float(np.median(list(noise.sd_m.values())))
        for label in (one for one in noise.drifting if one not in loose):
            sd = Quantity(noise.sd_m[label], "m", limit=_DRIFTING * usual_m)
            yield finding("M163", Where(trial=trial.name, markers=(label,)), sd_m=sd, usual_sd_m=Quantity(usual_m, "m"))
    for trial, distances in zip(context.fit.trials, posterior.marker_distances_m, strict=False):
        for label, away_m in distances.items():
            limit_m = _MOVED_M + (_CLAVICLE_M if label in shoulders else 0.0)
            if away_m > limit_m:
                away = Quantity(away_m, "m", limit=limit_m)
                yield finding("M162", Where(trial=trial.name, markers=(label,)), difference_m=away)


def _loose(skeleton: Skeleton) -> set[str]:
    """Return labels of markers that move without being loose: on the head, and on forearms, whose skin turns."""
    forearms = {m.label for m in skeleton.markers if str(segment_of(m.segment)).startswith("forearm")}
    return forearms.union(head_markers(skeleton))


def _at_shoulders(skeleton: Skeleton) -> set[str]:
    """Return labels of the trunk's markers over the shoulder joints."""
    centres = [
        (joint.parent, joint.translation)
        for joint in skeleton.joints
        if str(segment_of(joint.child)).startswith("upper_arm")
    ]
    return {
        marker.label
        for marker in skeleton.markers
        for parent, centre in centres
        if marker.segment == parent and np.linalg.norm(np.subtract(marker.position, centre)) < _SHOULDER_M
    }


def corrected_joints(context: ResultContext) -> Iterator[Finding]:
    """Report elbows that the static trial would bend backwards, a torso that arms would turn, and knees whose axis is
    elsewhere than in the static trial.
    """
    for side, rotation_rad in context.ready.elbow_rotations_rad.items():
        rotation = Quantity(rotation_rad, "rad", limit=_BACKWARDS_RAD)
        yield finding("M171", Where(part=f"{_SIDES[side]} elbow"), rotation_rad=rotation)
    if (torso_rad := context.ready.torso_rotation_rad) is not None:
        yield finding("M172", Where(part="torso"), rotation_rad=Quantity(torso_rad, "rad", limit=_TORSO_RAD))
    yield from _knee_axes(context)


def _knee_axes(context: ResultContext) -> Iterator[Finding]:
    """Report M175: knees whose axis the trials show elsewhere than the static trial, by either of its two angles."""
    for side, name in _SIDES.items():
        angles = [one for one in _calibrated(context) if one.joint == f"knee_{side}" and one.quantity == AXIS]
        if any(one.found for one in angles):
            worst = max(angles, key=lambda one: abs(one.value))
            rotation_rad = float(np.linalg.norm([one.value for one in angles]))
            rotation = Quantity(rotation_rad, "rad", limit=2.0 * worst.prior_sd, sd=worst.sd)
            yield finding("M175", Where(part=f"{name} knee"), rotation_rad=rotation)


def _calibrated(context: ResultContext) -> Sequence[CalibrationEntry]:
    posterior = context.fit.posterior
    return () if posterior is None else posterior.calibration
