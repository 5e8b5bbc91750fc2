"""M15: are there computed points among the measured markers? Programs export joint centres with the markers that they
were computed from.

No marker on the skin keeps its place within a tenth of a millimetre: a point that does, in axes through markers of
another segment or on the line between two, was computed from them. It contains no new information but would count as a
measurement.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics import needs
from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Recording

_EXACT_M, _SKIN_M = Limit(1e-4, "m"), 3e-4
"""Skin moves by more than the latter; where pelvis markers do not, they are computed themselves, or on one plate."""
_DISTANCE_M = 2.0 * _EXACT_M
"""SD of a point's distance from an origin above which it is exact in no axes there: that SD is at most the square root
of 3 times the largest of the coordinates'."""
_NEAR_M = 0.02
"""Change of distance from the pelvis' middle below which a point is fixed in it; thighs swing by more."""
_MOST_CORNERS = 5
_FRAMES, _FEWEST = 25, 10
_FLAT = 0.1
"""Sine of the angle of three markers that are nearly in line."""
_JOINTS = ("knee", "ankle", "elbow")


class _Computed(NamedTuple):
    """Labels from which a point was computed, and by how much (m) it moves relative to them."""

    sources: tuple[str, ...]
    sd_m: float


@check("M151", unless=needs.LENGTH_UNIT, exact=_EXACT_M)
def computed_markers(context: RecordingContext) -> Iterator[Finding]:
    """Report M151, one per point that was computed from other markers; of a motion."""
    if context.marker_set is not None:
        yield from computed_points(context.recording, context.marker_set, Severity.WARNING)


def computed_points(recording: Recording, marker_set: MarkerSet, severity: Severity) -> Iterator[Finding]:
    """Find points of a marker set that were computed from other markers of this recording: M151 of this severity."""
    markers = recording.markers
    few = markers.positions[:: -(-len(markers.time) // _FRAMES)]
    place = {label: few[:, k] for k, label in enumerate(markers.labels)}
    for label, computed in sorted({**_in_pelvis(place, marker_set), **_between(place, marker_set)}.items()):
        yield finding(
            "M151",
            Where(trial=recording.name, markers=(label,)),
            severity,
            sd_m=Quantity(computed.sd_m, "m", limit=_EXACT_M),
            sources=Quantity(", ".join(computed.sources)),
        )


def _in_pelvis(place: Mapping[str, FloatArray], marker_set: MarkerSet) -> dict[str, _Computed]:
    """Find markers of other segments that are fixed in the pelvis: in axes through three of its points (markers, or the
    middle of two), or in the rigid body that fits all its markers best.
    """
    corners = [label for label in marker_set.segments.get("pelvis", ()) if label in place][:_MOST_CORNERS]
    if len(corners) < 3:
        return {}
    pelvis = np.stack([place[label] for label in corners], axis=1)
    shown = np.isfinite(pelvis).all(axis=(1, 2))
    pelvis = pelvis[shown]
    pairs = list(combinations(range(len(corners)), 2))
    apart = np.stack([np.linalg.norm(pelvis[:, a] - pelvis[:, b], axis=1) for a, b in pairs])
    if len(pelvis) < _FEWEST or apart.std(axis=1).max() < _SKIN_M:
        return {}
    points = np.concatenate([pelvis, np.stack([pelvis[:, [a, b]].mean(axis=1) for a, b in pairs], axis=1)], axis=1)
    origins = np.concatenate([points, pelvis.mean(axis=1, keepdims=True)], axis=1)
    found, frames = {}, None
    others = {label for name, labels in marker_set.segments.items() if name != "pelvis" for label in labels}
    for label in others & set(place):
        own = place[label][shown]
        seen = np.isfinite(own).all(axis=1)
        away = np.linalg.norm(own[seen, None] - origins[seen], axis=2)
        if seen.sum() < _FEWEST or np.ptp(away[:, -1]) > _NEAR_M or away.std(axis=0).min() > _DISTANCE_M:
            continue
        frames = frames or (_frames(points), _best_fit(pelvis))  # few recordings need them
        for origin, axes in frames:
            local = np.einsum("ntji,ntj->nti", axes[seen], own[seen, None] - origin[seen])
            sd_m = float(local.std(axis=0).max(axis=1).min())
            if sd_m < _EXACT_M:
                found[label] = _Computed(tuple(corners), sd_m)
    return found


def _frames(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return origins (n, t, 3) and axes (n, t, 3, 3) through all triples of points (n, p, 3) that are not in line."""
    one, two, three = np.array(list(permutations(range(points.shape[1]), 3))).T
    origin = points[:, one]
    x, across = points[:, two] - origin, points[:, three] - origin
    lengths = np.linalg.norm(x, axis=2) * np.linalg.norm(across, axis=2)
    normal = np.cross(x, across)
    sine = np.linalg.norm(normal, axis=2) / np.maximum(lengths, 1e-12)
    bent = (sine > _FLAT).all(axis=0)
    origin, x, normal = origin[:, bent], x[:, bent], normal[:, bent]
    x, normal = (part / np.linalg.norm(part, axis=2, keepdims=True) for part in (x, normal))
    return origin, np.stack([x, np.cross(normal, x), normal], axis=3)


def _best_fit(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return origin (n, 1, 3) and axes (n, 1, 3, 3) of the rigid body that fits points (n, p, 3) best (Kabsch), with
    the shape of the first frame.
    """
    middle = points.mean(axis=1, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("npi,pj->nij", points - middle, (points - middle)[0]))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    return middle, (u @ vt)[:, None]


def _between(place: Mapping[str, FloatArray], marker_set: MarkerSet) -> dict[str, _Computed]:
    """Find markers that are always at the same share of the line from the lateral to the medial marker of a joint."""
    found = {}
    for joint in (f"{name}_{side}" for name in _JOINTS for side in "rl"):
        head, _, side = joint.partition("_")
        ends = [marker_set.landmarks.get(f"{head}_{which}_{side}", ()) for which in ("lateral", "medial")]
        if any(len(own) != 1 or own[0] not in place for own in ends):
            continue
        lateral, medial = (place[own[0]] for own in ends)
        for label in set(marker_set.labels) & set(place) - {ends[0][0], ends[1][0]}:
            from_lateral, along = place[label] - lateral, medial - lateral
            shown = np.isfinite(from_lateral).all(axis=1) & np.isfinite(along).all(axis=1)
            if shown.sum() < _FEWEST:
                continue
            from_lateral, along = from_lateral[shown], along[shown]
            share = float((from_lateral * along).sum() / np.square(along).sum())
            off = from_lateral - share * along
            if np.abs(off).max() < _EXACT_M:
                found[label] = _Computed((ends[0][0], ends[1][0]), float(off.std(axis=0).max()))
    return found
