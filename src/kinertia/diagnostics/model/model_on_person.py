"""Is an OpenSim model that of the person who moves, with the markers where they are on the person?

A fit that lets markers and joint centres move (`calibrate`) makes nearly any model fit the markers: what is wrong with
it goes into joint centres and bones, and so into joint moments, and nothing else tells. So the markers of the model in
its default pose are compared with those of the trial: their distances in one segment, as `same_body` does with a static
trial, and their arrangement as a whole.

On eleven sound pairs of model and trial from seven laboratories the median ratio of distances is within 1.1 %, their
difference 5 mm (RMS; 11 mm in one). The arrangement of pelvis and trunk fits the person's 0.02 to 0.3 times as far off
as its mirror image; where left and right are exchanged at least 3 times (of pelvis and thighs 0.7 and 1.3).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.diagnostics.evidence.segment_distances import LOWER_BODY, SegmentDistances
from kinertia.diagnostics.subject.same_body import swapped_labels, swapped_pairs
from kinertia.model.anatomy import segment_of
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Skeleton
from kinertia.trial.data import FloatArray, Markers

_OTHER_SCALE, _OTHER_BODY = 0.025, 0.05
"""Median share by which distances may differ: beyond the one a fit warns, beyond the other it refuses."""
_NOBODY = 5.0
"""Nobody is this many times as large as another."""
_FEWEST_PAIRS = 6
_ELSEWHERE_M = 0.014
_ARRANGED = {("pelvis", "torso"): (5, 1.6), ("pelvis", "thigh_r", "thigh_l"): (8, 1.15)}
"""Segments whose markers tell left from right, which pose hardly changes; how many it takes, and how many times as bad
a fit decides. Markers in one plane fit as well as their mirror image: then the next segments are asked."""
_MOVED_M = 0.055
"""Calibration moves markers of the lower body by 5 to 36 mm on sound trials."""
_FRAMES = 60
_THERE = "the model"


def model_on_person_trouble(places: Markers, trial: Markers, marker_set: MarkerSet) -> str:
    """Why model and trial cannot be used together; empty where they may.

    Args:
        places: one frame, the model's markers in its default pose.
        trial: of the person.
        marker_set: the model's markers by segment.
    """
    distances = SegmentDistances.of(places, trial, marker_set)
    if trouble := _other_unit(distances) or _mirrored(places, trial, marker_set):
        return trouble
    swapped = swapped_labels(distances, _THERE) or swapped_pairs(distances, _THERE) if len(distances.pairs) else ""
    return swapped or _other_body(distances)


def model_on_person_doubts(places: Markers, trial: Markers, marker_set: MarkerSet) -> list[str]:
    """What speaks against the model's scale and marker places, if `model_on_person_trouble` found nothing."""
    distances = SegmentDistances.of(places, trial, marker_set)
    if len(distances.pairs) < _FEWEST_PAIRS:
        return []
    if abs(distances.ratio() - 1.0) > _OTHER_SCALE:
        return [_scale_sentence(distances)]
    typical = float(np.sqrt(np.square(distances.differences()).mean()))
    if typical <= _ELSEWHERE_M:
        return []
    return [
        f"distances between markers of one segment differ from the model's by {1e3 * typical:.0f} mm (RMS of "
        f"{len(distances.pairs)}; most of all {distances.worst_pair()}): the model's markers were not moved to where "
        "they are on the person; let OpenSim's Scale tool place them on the static trial"
    ]


def moved_doubts(before: Skeleton, after: Skeleton, trials: Sequence[Markers]) -> list[str]:
    """Markers of the lower body that calibration moved farther than a marker is ever put elsewhere.

    Args:
        before, after: the model's skeleton and the calibrated one.
        trials: their markers.
    """
    shown = {label for markers in trials for label in markers.labels}
    place = {marker.label: np.array(marker.position) for marker in before.markers}
    moved = [
        (float(np.linalg.norm(np.array(marker.position) - place[marker.label])), marker)
        for marker in after.markers
        if marker.label in shown and segment_of(marker.segment) in LOWER_BODY
    ]
    far = sorted((one for one in moved if one[0] > _MOVED_M), key=lambda one: -one[0])
    if not far:
        return []
    listed = ", ".join(f"{marker.label} ({marker.segment}, {1e3 * metres:.0f} mm)" for metres, marker in far)
    return [
        f"calibration moved these markers far from where the model has them in their segments: {listed}; labels that "
        "are exchanged, in the model or in the trial, or a model that is not this person's do that, and joint centres "
        "follow them: correct the labels, or place the model's markers on the static trial with OpenSim's Scale tool"
    ]


def _other_unit(distances: SegmentDistances) -> str:
    if len(distances.pairs) < _FEWEST_PAIRS or 1.0 / _NOBODY < distances.ratio() < _NOBODY:
        return ""
    return (
        f"distances between markers of one segment are {distances.ratio():.3g} times those of the model (median of "
        f"{len(distances.pairs)}): one of the two has another unit of length than its file says (mm, cm or m); correct "
        "it there"
    )


def _other_body(distances: SegmentDistances) -> str:
    if len(distances.pairs) < _FEWEST_PAIRS or abs(distances.ratio() - 1.0) <= _OTHER_BODY:
        return ""
    return _scale_sentence(distances)


def _scale_sentence(distances: SegmentDistances) -> str:
    share = distances.ratio() - 1.0
    longer = "longer" if share > 0 else "shorter"
    return (
        f"distances between markers of one segment are {100 * abs(share):.1f} % {longer} than in the model (median of "
        f"{len(distances.pairs)}; most of all {distances.worst_pair()}): the model was not scaled, or to another "
        "person, or its markers were not placed, or the cameras' scale is wrong; scale it to this person's static "
        "trial with OpenSim's Scale tool"
    )


def _mirrored(places: Markers, trial: Markers, marker_set: MarkerSet) -> str:
    """The person's markers are rather arranged as the model's mirror image."""
    for names, (fewest, limit) in _ARRANGED.items():
        worn = [marker_set.segments.get(name, ()) for name in names]
        parts = [[label for label in own if label in trial.labels] for own in worn]
        labels = [label for part in parts for label in part]
        person = trial.select(labels).positions
        whole = np.flatnonzero(np.isfinite(person).all(axis=(1, 2)))
        if not all(parts) or len(labels) < fewest or not len(whole):
            continue
        model = places.select(labels).positions[0]
        ratio = _mirror_ratio(model, person[whole[:: max(len(whole) // _FRAMES, 1)]])
        if ratio > limit:
            return (
                f"the markers of {', '.join(names)} are arranged like a mirror image of the model's (its default pose "
                f"fits them {ratio:.1f} times as badly as its mirror image): all left and right labels are exchanged "
                "in one of the two, or an axis of one is mirrored; correct the labels or the axis"
            )
        if ratio < 1.0 / limit:
            break
    return ""


def _mirror_ratio(model: FloatArray, person: FloatArray) -> float:
    """How badly points (m, 3) fit frames (n, m, 3) when turned, over how badly their mirror image does: the median.

    The singular values of both points' product give the least squares (Kabsch 1976, Acta Cryst A 32:922).
    """
    one, other = model - model.mean(axis=0), person - person.mean(axis=1, keepdims=True)
    left, values, right = np.linalg.svd(one.T @ other)
    sign = np.sign(np.linalg.det(left @ right))
    squares = np.square(one).sum() + np.square(other).sum(axis=(1, 2))
    turned = squares - 2.0 * (values[:, 0] + values[:, 1] + sign * values[:, 2])
    mirrored = squares - 2.0 * (values[:, 0] + values[:, 1] - sign * values[:, 2])
    return float(np.median(np.sqrt(np.maximum(turned, 0.0) / np.maximum(mirrored, 1e-12))))
