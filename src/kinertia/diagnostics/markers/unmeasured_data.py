"""M12 and M15: are all frames and markers measured? Missing, copied, interpolated frames, and computed points.

On 17 measured recordings of motions and ten synthetic ones no frame repeats the one before it, hardly any lies midway
between its neighbours, and the median marker's step (`trajectory_faults`) is at most 1.5 mm.

No marker on the skin keeps its place within a tenth of a millimetre: a point that does, in axes through markers of
another segment or on the line between two, was computed from them. It contains no new information but would count as a
measurement.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.trajectory_faults import (
    COPIED_SHARE,
    FEWEST_FRAMES,
    LEAST_MOTION_M,
    CopiedFrames,
    brief_runs,
    slowness,
    steps,
    without_copied_frames,
)
from kinertia.diagnostics.runner import NEEDS_LENGTH_UNIT, check
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import BoolArray, FloatArray, Markers, Recording
from kinertia.trial.sampled_data import runs

_MISSING_M, _MISSING_TIMES = Limit(0.006, "m", usual=(0.0, 0.0015)), Limit(3.0)
"""Step of the median marker where frames are missing: at least this distance, and this multiple of its usual step.
Noisy cameras move all markers, in every frame."""
_FEW_COPIED = Limit(0.05)
"""Share of the frames up to which copies of dropped frames are treated as gaps (`without_copied_frames`)."""
_INTERPOLATED_SHARE, _STRAIGHT = Limit(0.4), 0.03
"""Of three frames drawn between two measured ones all lie in the middle between their neighbours: they bend by less
than this share of how much the quick frames bend."""
_LEAST_RATE_HZ = Limit(45.0, "Hz", usual=(60.0, 250.0))
"""With frames of five walks left out, joint moments changed by .1 to .9 SDs at 50 Hz, but for one (3.1), and by up to
3.8 SDs at 30 Hz."""
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


@check(
    "M121",
    "M122",
    "M123",
    "M124",
    unless=NEEDS_LENGTH_UNIT,
    step=_MISSING_M,
    times=_MISSING_TIMES,
    few=_FEW_COPIED,
    copied=COPIED_SHARE,
    interpolated=_INTERPOLATED_SHARE,
    rate=_LEAST_RATE_HZ,
)
def frames(context: RecordingContext) -> Iterator[Finding]:
    """Report M121 to M124: missing frames (one finding per cut), copied frames, interpolated frames, too few frames."""
    markers = context.markers
    if markers.rate_hz < _LEAST_RATE_HZ:
        rate = Quantity(markers.rate_hz, "Hz", limit=_LEAST_RATE_HZ, usual=_LEAST_RATE_HZ.usual)
        yield finding("M124", context.at(), rate_hz=rate)
    if len(markers.time) < FEWEST_FRAMES:
        return
    copies = CopiedFrames.of(markers)
    if upsampled := _upsampled(context, copies):
        yield upsampled
        return
    if copies.fill_lost_frames:
        yield _copied(context, copies)
    yield from _missing(context)


def _upsampled(context: RecordingContext, copies: CopiedFrames) -> Finding | None:
    markers = context.markers
    interpolated = float(brief_runs(_between(markers.positions), markers.rate_hz).mean())
    if copies.share > COPIED_SHARE:
        share, limit, method = copies.share, COPIED_SHARE, "held"
    elif interpolated > _INTERPOLATED_SHARE and not copies.fill_lost_frames:
        share, limit, method = interpolated, _INTERPOLATED_SHARE, "interpolated"
    else:
        return None
    return finding(
        "M123",
        context.at(),
        share=Quantity(share, "1", limit=limit, usual=(0.0, 0.0)),
        true_rate_hz=Quantity(markers.rate_hz * (1.0 - share), "Hz"),
        rate_hz=Quantity(markers.rate_hz, "Hz"),
        method=Quantity(method),
    )


def _copied(context: RecordingContext, copies: CopiedFrames) -> Finding:
    time = context.markers.time[copies.copied]
    few = copies.share <= _FEW_COPIED and not copies.insertions
    return finding(
        "M122",
        context.at(span_s=(float(time[0]), float(time[-1]))),
        Severity.WARNING if few else None,
        frames=Quantity(float(len(time)), "1", usual=(0.0, 0.0)),
        share=Quantity(copies.share, "1", limit=_FEW_COPIED),
        inserted=Quantity(float(copies.insertions), "1"),
        first_s=Quantity(float(time[0]), "s"),
    )


def _missing(context: RecordingContext) -> Iterator[Finding]:
    """Find cuts where most markers step at once, up to the last load: frames missing before it delay the forces."""
    markers = without_copied_frames(context.markers)
    if context.contact_span_s is not None:
        markers = markers.cut(markers.time[0], context.contact_span_s[1])
    if len(markers.time) < FEWEST_FRAMES:
        return
    step = _median_step_m(markers)
    shown = np.isfinite(step)
    usually = float(np.median(step[shown])) if shown.any() else 0.0
    limit = max(_MISSING_M * slowness(markers.rate_hz), _MISSING_TIMES * usually)
    beyond = np.nan_to_num(step) > limit
    # a cut makes the steps before and after it look half as large
    near = np.pad(beyond, 1)
    for first, last in runs(beyond | near[2:] | near[:-2]):
        cut = first + int(np.nanargmax(step[first : last + 1]))
        span = (float(markers.time[cut + 1]), float(markers.time[cut + 2]))
        yield finding(
            "M121",
            context.at(span_s=span),
            step_m=Quantity(float(step[cut]), "m", limit=limit, usual=_MISSING_M.usual),
            frames=Quantity(float(_frames_lost(markers, cut)), "1"),
            time_s=Quantity(span[1], "s"),
        )


def _median_step_m(markers: Markers) -> FloatArray:
    """Return the step (n - 3,) m of the median marker; NaN where half of the markers are not visible."""
    size = np.linalg.norm(steps(markers.positions), axis=-1)
    shown = np.isfinite(size).sum(axis=1) > 0.5 * len(markers.labels)
    median = np.full(len(size), np.nan)
    median[shown] = np.nanmedian(size[shown], axis=1)
    return median


def _frames_lost(markers: Markers, cut: int) -> int:
    """Return the number of missing frames, from how far markers move across a cut and next to it."""
    went = np.linalg.norm(np.diff(markers.positions, axis=0), axis=-1)
    usual = float(np.nanmedian(np.concatenate([went[cut : cut + 1], went[cut + 2 : cut + 3]])))
    return max(1, round(float(np.nanmedian(went[cut + 1])) / max(usual, 1e-4)) - 1)


def _between(position: FloatArray) -> BoolArray:
    """Find frames (n - 2,) in which most markers are midway between their neighbours, unless they are in all frames."""
    bend = np.linalg.norm(np.diff(position, n=2, axis=0), axis=2)
    shown = np.isfinite(bend).any(axis=1)
    went = np.linalg.norm(np.diff(position, axis=0), axis=2)
    if not shown.any() or not np.nanmedian(went) > LEAST_MOTION_M:
        return np.zeros(len(bend), dtype=bool)
    typical = np.full(len(bend), np.nan)
    typical[shown] = np.nanmedian(bend[shown], axis=1)
    quick = float(np.nanquantile(typical, 0.95))
    return np.asarray(shown & (np.nan_to_num(typical, nan=np.inf) < _STRAIGHT * quick))


class _Computed(NamedTuple):
    """Labels from which a point was computed, and by how much (m) it moves relative to them."""

    sources: tuple[str, ...]
    sd_m: float


@check("M151", unless=NEEDS_LENGTH_UNIT, exact=_EXACT_M)
def computed_markers(context: RecordingContext) -> Iterator[Finding]:
    """Report M151, one per point that was computed from other markers; of a motion."""
    if context.marker_set is not None:
        yield from computed_points(context.recording, context.marker_set, Severity.WARNING)


def computed_points(recording: Recording, marker_set: MarkerSet, severity: Severity) -> Iterator[Finding]:
    """Find points of a marker set that were computed from other markers of this recording: M151 of this severity."""
    markers = recording.markers
    few = markers.positions[:: -(-len(markers.time) // _FRAMES)]
    place = {label: few[:, k] for k, label in enumerate(markers.labels)}
    for label, computed in sorted({**_in_pelvis(place, marker_set), **_halfway(place, marker_set)}.items()):
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
        candidate = place[label][shown]
        seen = np.isfinite(candidate).all(axis=1)
        away = np.linalg.norm(candidate[seen, None] - origins[seen], axis=2)
        if seen.sum() < _FEWEST or np.ptp(away[:, -1]) > _NEAR_M or away.std(axis=0).min() > _DISTANCE_M:
            continue
        frames = frames or (_frames(points), _best_fit(pelvis))  # few recordings need them
        for origin, axes in frames:
            local = np.einsum("ntji,ntj->nti", axes[seen], candidate[seen, None] - origin[seen])
            sd_m = float(local.std(axis=0).max(axis=1).min())
            if sd_m < _EXACT_M:
                found[label] = _Computed(tuple(corners), sd_m)
    return found


def _frames(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return origins (n, t, 3) and axes (n, t, 3, 3) through all triples of points (n, p, 3) that are not in line."""
    first, second, three = np.array(list(permutations(range(points.shape[1]), 3))).T
    origin = points[:, first]
    x, across = points[:, second] - origin, points[:, three] - origin
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


def _halfway(place: Mapping[str, FloatArray], marker_set: MarkerSet) -> dict[str, _Computed]:
    """Find markers that are always at the same share of the line from the lateral to the medial marker of a joint."""
    found = {}
    for joint in (f"{name}_{side}" for name in _JOINTS for side in "rl"):
        head, _, side = joint.partition("_")
        ends = [marker_set.landmarks.get(f"{head}_{which}_{side}", ()) for which in ("lateral", "medial")]
        if any(len(end) != 1 or end[0] not in place for end in ends):
            continue
        lateral, medial = (place[end[0]] for end in ends)
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
