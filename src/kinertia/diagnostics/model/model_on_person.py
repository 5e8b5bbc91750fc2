"""Does an OpenSim model belong to the person in the trials: its markers and bodies, its size, its ranges of motion?

A fit that lets markers and joint centres move (`calibrate`) makes nearly any model fit the markers: its errors go
unnoticed into joint centres and segment lengths, and so into joint moments. Therefore the markers of the model in its
default pose are compared with the markers of the trial: by distances within segments, as `same_person` compares a
static trial, and by their arrangement as a whole.

On eleven fault-free pairs of model and trial from seven laboratories the median ratio of distances is within 1.1 %,
their difference 5 mm (RMS; 11 mm in one). The misfit of pelvis and trunk to the person is 0.02 to 0.3 times the misfit
of their mirror image, and at least 3 times if left and right are interchanged (for pelvis and thighs 0.7 and 1.3).
"""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.context import PersonContext
from kinertia.diagnostics.evidence.segment_distances import FEWEST_PAIRS, LOWER_BODY, SegmentDistances, swapped_labels
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.anatomy import segment_of
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import InverseKinematics
from kinertia.trial.data import FloatArray, Markers
from kinertia.trial.sampled_data import rms

_OTHER_SCALE, _OTHER_BODY = Limit(0.025, usual=(-0.011, 0.011)), Limit(0.05)
"""Median share by which distances may differ: beyond the one a fit warns, beyond the other it refuses."""
_NOBODY = Limit(5.0)
"""Ratio of sizes that no two people have."""
_ELSEWHERE_M = Limit(0.014, "m", usual=(0.0, 0.011))
_MIRRORED, _PLAINLY = Limit(1.6, usual=(0.02, 0.3)), Limit(1.15)
_ARRANGED = {("pelvis", "torso"): (5, _MIRRORED), ("pelvis", "thigh_r", "thigh_l"): (8, _PLAINLY)}
"""Segments whose markers distinguish left from right in any pose; how many are needed, and how many times worse a fit
decides. Markers in one plane fit as well as their mirror image: then the next segments are used."""
MOVED_M = Limit(0.055, "m", usual=(0.005, 0.036))
"""Calibration moves markers of the lower body by 5 to 36 mm on fault-free trials."""
_FRAMES = 60
AT_LIMIT, BEYOND_RAD = Limit(0.05), Limit(np.radians(10.0), "rad")
"""Share of the frames, and angle, from which on a limit of a coordinate's range is reported."""
CLAMPED = Limit(0.2, usual=(0.0, 0.08))
"""Share of the frames from which on a clamped coordinate of legs or trunk is a fault of the model: on 30 fault-free
trials with models of six makers it is 0.08 at most (knees that end straight), in one that clamps knees at 10 degrees
0.33."""


@check(
    "L212",
    "O401",
    "O402",
    "O404",
    "O405",
    size=_NOBODY,
    mirrored=_MIRRORED,
    plainly=_PLAINLY,
    share=_OTHER_SCALE,
    body=_OTHER_BODY,
    distance=_ELSEWHERE_M,
)
def model_and_trials(context: PersonContext) -> Iterator[Finding]:
    """Report O401, O402, L212, O404 and O405: each trial's markers indicate another unit (O401), left and right
    interchanged (O402), swapped labels (L212), another scale (O404), or markers that were not placed (O405).
    """
    marker_set = context.marker_set
    if context.model is None or marker_set is None or marker_set.in_model is None:
        return
    for trial in context.trials:
        where, positions = Where(trial=trial.name), marker_set.in_model
        mirrored = _mirrored(positions, trial.markers, marker_set)
        if mirrored is not None:
            yield finding("O402", where, ratio=mirrored)
        distances = SegmentDistances.of(positions, trial.markers, marker_set)
        if len(distances.pairs):
            yield from swapped_labels(distances, trial.name, "model")
        if len(distances.pairs) < FEWEST_PAIRS:
            continue
        ratio = distances.ratio()
        if not 1.0 / _NOBODY < ratio < _NOBODY:
            yield finding("O401", where, ratio=Quantity(ratio, "1", limit=_NOBODY))
        if abs(ratio - 1.0) > _OTHER_SCALE:
            severity = Severity.ERROR if abs(ratio - 1.0) > _OTHER_BODY else Severity.WARNING
            limit = 1.0 + _OTHER_SCALE * float(np.sign(ratio - 1.0))
            scale = Quantity(ratio, "1", limit=limit, usual=(0.989, 1.011))
            yield finding("O404", where, severity, ratio=scale, worst_pair=Quantity(distances.worst_pair()))
        rms_m = rms(distances.differences())
        if rms_m > _ELSEWHERE_M:
            apart = Quantity(rms_m, "m", limit=_ELSEWHERE_M, usual=_ELSEWHERE_M.usual)
            yield finding("O405", where, rms_m=apart, worst_pair=Quantity(distances.worst_pair()))


def moved_markers(before: Skeleton, after: Skeleton, trials: Sequence[Markers]) -> Iterator[Finding]:
    """Report O407: markers of the lower body that calibration moved farther than a marker is ever misplaced.

    Args:
        before, after: the model's skeleton and the calibrated one.
        trials: their markers.
    """
    shown = {label for markers in trials for label in markers.labels}
    place = {marker.label: np.array(marker.position) for marker in before.markers}
    for marker in after.markers:
        distance_m = float(np.linalg.norm(np.array(marker.position) - place[marker.label]))
        if marker.label in shown and segment_of(marker.segment) in LOWER_BODY and distance_m > MOVED_M:
            distance = Quantity(distance_m, "m", limit=MOVED_M, usual=MOVED_M.usual)
            yield finding("O407", Where(markers=(marker.label,), part=marker.segment), distance_m=distance)


def _mirrored(places: Markers, trial: Markers, marker_set: MarkerSet) -> Quantity | None:
    """Return how many times worse the model fits the markers than its mirror image does, where that is decisive."""
    for names, (fewest, limit) in _ARRANGED.items():
        of_segments = [marker_set.segments.get(name, ()) for name in names]
        parts = [[label for label in labels if label in trial.labels] for labels in of_segments]
        labels = [label for part in parts for label in part]
        person = trial.select(labels).positions
        whole = np.flatnonzero(np.isfinite(person).all(axis=(1, 2)))
        if not all(parts) or len(labels) < fewest or not len(whole):
            continue
        model = places.select(labels).positions[0]
        ratio = _mirror_ratio(model, person[whole[:: max(len(whole) // _FRAMES, 1)]])
        if ratio > limit:
            return Quantity(ratio, "1", limit=limit, usual=_MIRRORED.usual)
        if ratio < 1.0 / limit:
            break
    return None


def _mirror_ratio(model: FloatArray, person: FloatArray) -> float:
    """Return the misfit of rotated points (m, 3) to frames (n, m, 3) over that of their mirror image: the median.

    The singular values of both points' product give the least squares (Kabsch 1976, Acta Cryst A 32:922).
    """
    centred, other = model - model.mean(axis=0), person - person.mean(axis=1, keepdims=True)
    left, values, right = np.linalg.svd(centred.T @ other)
    sign = np.sign(np.linalg.det(left @ right))
    squares = np.square(centred).sum() + np.square(other).sum(axis=(1, 2))
    turned = squares - 2.0 * (values[:, 0] + values[:, 1] + sign * values[:, 2])
    mirrored = squares - 2.0 * (values[:, 0] + values[:, 1] - sign * values[:, 2])
    return float(np.median(np.sqrt(np.maximum(turned, 0.0) / np.maximum(mirrored, 1e-12))))


@check("O106", "O107")
def markers_and_feet(context: PersonContext) -> Iterator[Finding]:
    """Report O106 and O107: a model without markers, which only a fit needs (O106), or without a body of a foot
    (O107)."""
    model = context.model
    if model is None:
        return
    if not model.skeleton.markers:
        yield finding("O106", None, Severity.ERROR if context.has_trials else Severity.INFO, count=Quantity(0, "1"))
    for side, foot in (("r", "right foot"), ("l", "left foot")):
        if context.has_trials and not any(segment_of(body) == f"foot_{side}" for body in model.skeleton.segments):
            yield finding("O107", Where(part=foot), expected=Quantity(f"calcn_{side} or foot_{side}"))


@check("O414")
def unmatched_markers(context: PersonContext) -> Iterator[Finding]:
    """Report O414: markers of a trial that the model does not have."""
    if context.model is None:
        return
    known = set(context.model.skeleton.labels)
    for trial in context.trials:
        unknown = tuple(label for label in trial.all_markers.labels if label not in known)
        if unknown:
            yield finding("O414", Where(trial=trial.name, markers=unknown), source=Quantity("trial"))


def range_findings(skeleton: Skeleton, ik: InverseKinematics) -> Iterator[Finding]:
    """Report O311 and O312: legs and trunk that stay at a clamped limit, so that other joints compensate (O311); other
    coordinates that stay at one, or exceed the usual range of a joint (O312).

    Args:
        skeleton: skeleton with its ranges of motion.
        ik: inverse kinematics of one trial.
    """
    bounds, known = skeleton.bounds, np.isfinite(ik.q)
    at_limit = ((ik.q <= bounds.least) | (ik.q >= bounds.most)).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    within = np.where(known, ik.q, bounds.clamped(np.zeros_like(ik.q)))
    past_range = np.abs(bounds.beyond(within))
    at_or_beyond = ((ik.q <= bounds.least) | (ik.q >= bounds.most) | (past_range > 0.0)).sum(axis=0)
    beyond = past_range.max(axis=0)
    central = [skeleton.segments.index(foot) for foot in skeleton.feet]
    central += [k for k, segment in enumerate(skeleton.segments) if segment_of(segment) == "torso"]
    moves = set(skeleton.map.owner[skeleton.support[central].any(axis=0)].tolist())
    for c, name in enumerate(ik.coordinates):
        unit = "rad" if skeleton.rotational[c] else "m"
        limits = Quantity((float(bounds.least[c]), float(bounds.most[c])), unit)
        share, past = float(at_limit[c]), float(beyond[c])
        if share > CLAMPED and c in moves:
            clamped = Quantity(share, "1", limit=CLAMPED, usual=CLAMPED.usual)
            yield finding("O311", Where(part=name), share=clamped, range_rad=limits)
        if share > AT_LIMIT or (past > BEYOND_RAD and skeleton.rotational[c]):
            frames = Quantity(float(at_or_beyond[c]) / max(int(known[:, c].sum()), 1), "1", limit=AT_LIMIT)
            yield finding("O312", Where(part=name), share=frames, beyond_rad=Quantity(past, unit, limit=BEYOND_RAD))
