"""Are the static trial and the trials of one person, in one session? Distances between markers of one segment show it.

Medians over the frames are compared for pelvis, legs and feet, but not for the upper body, whose skin moves with the
arms. On ten fault-free pairs of a static trial and a trial, measured in five laboratories, distances differ by 4.6 mm
RMS at most, and single ones by 17 mm; their ratio is within 1.2 %.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinertia.diagnostics.context import PersonContext, RecordingContext, odd_ones
from kinertia.diagnostics.evidence.segment_distances import (
    FEWEST_PAIRS,
    SAME_SESSION_M,
    SegmentDistances,
    swapped_labels,
)
from kinertia.diagnostics.runner import check
from kinertia.diagnostics.subject.same_session import AGAINST_STANDING, ERRORS, FAR_M, OTHER_SCALE, camera_scale
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Recording
from kinertia.trial.sampled_data import rms

_OTHER_PERSON = Limit(0.05, usual=(-0.012, 0.012))
"""Median share by which the distances may differ."""
_REAPPLIED_M, _TYPICAL_BEYOND_M, _CERTAIN, _OF_MEDIAN = Limit(0.0141, "m"), Limit(0.012, "m"), Limit(4.0), 1.25
"""RMS and median difference, standard errors, and the error of a median over that of a mean. Markers re-applied 10 mm
away along each axis change a distance by the first; the RMS over the distances of a dozen markers is then up to 24 mm,
and their median share up to 10 %."""
_OTHER_MASS, _OTHER_STATURE = Limit(0.05), Limit(0.03)
"""Shares by which mass and stature of two recordings differ for them not to be of one person in one session."""
_MOVED_M, _MOVED_BETWEEN_M, _MOVED_SHARE = Limit(0.03, "m", usual=(0.0, 0.017)), Limit(0.04, "m"), Limit(0.15)
"""Difference of a distance where a marker was moved: from a static trial; between trials, where soft thighs
change shape, a length and a share."""
_MOST_MOVED = 3
"""Where more markers were moved, all of them may have been."""
Span = tuple[float, float] | None


@check(
    "L212",
    "M161",
    "S203",
    "S204",
    "S205",
    ratio=_OTHER_PERSON,
    reapplied=_REAPPLIED_M,
    typical=_TYPICAL_BEYOND_M,
    certain=_CERTAIN,
    session=SAME_SESSION_M,
    mass=_OTHER_MASS,
    stature=_OTHER_STATURE,
    moved=_MOVED_M,
    moved_between=_MOVED_BETWEEN_M,
    moved_share=_MOVED_SHARE,
    apart=FAR_M,
    scale=OTHER_SCALE,
    errors=ERRORS,
    standing=AGAINST_STANDING,
)
def static_and_trials(context: PersonContext) -> Iterator[Finding]:
    """Report L212, S203, S205, M161 and S204: swapped labels (L212), another person (S203), another camera scale
    (S205), moved (M161) or re-applied markers (S204) in trials, compared with the static trial.

    Of several recordings in which the person stands each is compared; one that a trial contradicts while it agrees
    with another is itself the one at fault.
    """
    marker_set = context.marker_set
    if marker_set is None:
        return
    # labels that are swapped in a static trial put its distances wrong
    references = [standing for standing in context.standing if not context.has_error(standing.name, "L20")]
    for trial in context.trials:
        found = [
            list(_against(reference, trial, marker_set, trial.name, _called(context, reference), AGAINST_STANDING))
            for reference in references
        ]
        if all(found):
            yield from _joined(found)
            continue
        for reference, of_reference in zip(references, found, strict=True):
            if of_reference:
                yield from _against(
                    trial, reference, marker_set, reference.name, f"trial {trial.name}", -AGAINST_STANDING
                )


@check("M161", "S305", ratio=_OTHER_PERSON, moved=_MOVED_M, moved_between=_MOVED_BETWEEN_M, moved_share=_MOVED_SHARE)
def trials_of_one_person(context: PersonContext) -> Iterator[Finding]:
    """Report S305 and M161: two trials of different people (S305), or with a marker that was moved in between (M161);
    of the two, the one that static trial and other trials contradict, or both where neither is contradicted.
    """
    marker_set = context.marker_set
    if marker_set is None:
        return
    for first, other in combinations(context.trials, 2):
        distances = SegmentDistances.of(first.all_markers, other.all_markers, marker_set)
        if not len(distances.pairs):
            continue
        ratio = distances.ratio()
        moved = _moved_markers(distances, _MOVED_BETWEEN_M, _MOVED_SHARE)
        if not moved and (len(distances.pairs) < FEWEST_PAIRS or abs(ratio - 1.0) <= _OTHER_PERSON):
            continue
        further = [recording for recording in (*context.standing, *context.trials) if recording not in (first, other)]
        for odd in odd_ones(first, other, _witnesses(first, other, further, marker_set, moved)):
            peer = other if odd is first else first
            yield from _moved_findings(moved, odd.name, f"trial {peer.name}")
            if not moved:
                share = ratio if odd is other else 1.0 / ratio
                yield finding(
                    "S305",
                    Where(trial=odd.name),
                    ratio=Quantity(share, "1", limit=1.0 + _OTHER_PERSON * np.sign(share - 1.0)),
                    pairs=Quantity(len(distances.pairs), "1"),
                    other_trial=Quantity(peer.name),
                )


def _against(
    reference: RecordingContext, trial: RecordingContext, marker_set: MarkerSet, at: str, called: str, usual: float
) -> Iterator[Finding]:
    """Find the differences of a recording from a reference, reported in the recording `at`."""
    distances = SegmentDistances.of(reference.all_markers, trial.all_markers, marker_set)
    if not len(distances.pairs):
        return
    swapped = list(swapped_labels(distances, at, called))
    yield from swapped
    exchanged = {label for swap in swapped for label in swap.where.markers}
    moved = _moved_markers(distances, _MOVED_M, 0.0, exchanged)
    count, rms_m = len(distances.pairs), rms(distances.differences())
    if count >= FEWEST_PAIRS:
        yield from _other_person(distances, reference, trial, at, called, whole=not swapped and not moved)
    if (scale := camera_scale(distances, usual)) is not None:
        yield scale.finding(at, called)
    yield from _moved_findings(moved, at, called)
    if count >= FEWEST_PAIRS and rms_m > SAME_SESSION_M:
        yield finding(
            "S204",
            Where(trial=at),
            rms_m=Quantity(rms_m, "m", limit=SAME_SESSION_M, usual=SAME_SESSION_M.usual),
            worst_pair=Quantity(distances.worst_pair()),
            reference=Quantity(called),
        )


def _other_person(
    distances: SegmentDistances,
    reference: RecordingContext,
    trial: RecordingContext,
    at: str,
    called: str,
    *,
    whole: bool,
) -> Iterator[Finding]:
    """Report S203: distances at another scale, or that differ more than after markers are re-applied, or as much where
    body data also differ; the latter unless a few labels explain the differences (not `whole`).
    """
    off, ratio = distances.differences(), distances.ratio()
    rms_m, typical_m = rms(off), float(np.median(np.abs(off)))
    markers, (before, after) = min(len(np.unique(distances.pairs)), len(distances.pairs)), distances.lengths()
    by_chance = _CERTAIN * _OF_MEDIAN * float(np.median(_REAPPLIED_M / before)) / np.sqrt(markers)
    certain = abs(ratio - 1.0) > by_chance or rms(after / ratio - before) <= SAME_SESSION_M
    scaled = abs(ratio - 1.0) > _OTHER_PERSON and certain
    beyond_m = _REAPPLIED_M * (1.0 + _CERTAIN / np.sqrt(2.0 * markers))
    far = whole and rms_m > beyond_m and typical_m > _TYPICAL_BEYOND_M
    data = _other_body_data(reference, trial) if whole and rms_m > SAME_SESSION_M else ""
    if not (scaled or far or data):
        return
    difference = f"a factor of {ratio:.3g}" if scaled else f"{1e3 * rms_m:.0f} mm RMS"
    yield finding(
        "S203",
        Where(trial=at),
        ratio=Quantity(ratio, "1", limit=1.0 + _OTHER_PERSON * float(np.sign(ratio - 1.0)), usual=(0.988, 1.012)),
        rms_m=Quantity(rms_m, "m", limit=SAME_SESSION_M if data else beyond_m, usual=SAME_SESSION_M.usual),
        pairs=Quantity(len(distances.pairs), "1"),
        worst_m=Quantity(float(off[np.argmax(np.abs(off))]), "m"),
        reference=Quantity(called),
        difference=Quantity(difference + data),
        unit=Quantity(", or in another unit" if scaled else ""),
    )


def _other_body_data(reference: RecordingContext, trial: RecordingContext) -> str:
    """Describe how mass or stature of two recordings differ: stated in their files, else as their plates weigh them."""
    expected, other = reference.recording, trial.recording
    for first, second, limit, unit in (
        (expected.mass_kg, other.mass_kg, _OTHER_MASS, "kg"),
        (expected.height_m, other.height_m, _OTHER_STATURE, "m"),
    ):
        if first and second and abs(np.log(second / first)) > limit:
            return f"; its file states {first:.4g} {unit}, that of {trial.name} {second:.4g} {unit}"
    standing, moving = reference.standing_mass, trial.force_mass
    if standing is None or moving is None:
        return ""
    allowed_kg = _OTHER_MASS * moving.mass_kg + 2.0 * float(np.hypot(standing.sd_kg, moving.sd_kg))
    if abs(standing.mass_kg - moving.mass_kg) <= allowed_kg:
        return ""
    return f"; its plates weigh {standing.mass_kg:.3g} kg, those of {trial.name} {moving.mass_kg:.3g} kg"


@dataclass(frozen=True)
class _Moved:
    """A moved marker: its label, or both labels if only their distance shows it; by how much, relative to which."""

    labels: tuple[str, ...]
    difference_m: float
    to_marker: str


def _moved_markers(
    distances: SegmentDistances, least_m: float, least_share: float, exchanged: Collection[str] = ()
) -> tuple[_Moved, ...]:
    """Find the few markers without which all distances agree, except those of swapped labels; none where distances also
    differ without them.
    """
    off = distances.differences()
    before, after = distances.lengths()
    far = (np.abs(off) > least_m) & (np.abs(off) > least_share * np.minimum(before, after))
    moved: list[_Moved] = []
    kept = ~np.isin(distances.pairs, [k for k, label in enumerate(distances.labels) if label in exchanged]).any(axis=1)
    while (far & kept).any() and len(moved) < _MOST_MOVED:
        # one marker that moved takes all of its distances along
        about = [np.abs(off[kept & _with(distances, k)]) for k in range(len(distances.labels))]
        k = int(np.argmax([np.median(distances_m) if len(distances_m) else 0.0 for distances_m in about]))
        mates = distances.pairs[far & kept & _with(distances, k)]
        if not len(mates):
            return ()
        mate = distances.labels[int(mates[0][0] if mates[0][1] == k else mates[0][1])]
        label = distances.labels[k]
        labels = (label,) if _with(distances, k).sum() > 1 else (label, mate)
        moved.append(_Moved(labels, float(about[k].max()), mate))
        kept &= ~_with(distances, k)
    rest = off[kept]
    agree = not (far & kept).any() and (not len(rest) or rms(rest) <= SAME_SESSION_M)
    return tuple(moved) if agree else ()


def _with(distances: SegmentDistances, k: int) -> NDArray[np.bool_]:
    """Return (p,) which pairs include this marker."""
    result: NDArray[np.bool_] = (distances.pairs == k).any(axis=1)
    return result


def _moved_findings(moved: Sequence[_Moved], at: str, called: str) -> Iterator[Finding]:
    for marker in moved:
        yield finding(
            "M161",
            Where(trial=at, markers=marker.labels),
            difference_m=Quantity(marker.difference_m, "m", limit=_MOVED_M, usual=_MOVED_M.usual),
            to_marker=Quantity(marker.to_marker),
            reference=Quantity(called),
        )


class _Witness(NamedTuple):
    """Distances of a further recording from the two that disagree."""

    to_first: float
    to_other: float


def _witnesses(
    first: RecordingContext,
    other: RecordingContext,
    further: Sequence[RecordingContext],
    marker_set: MarkerSet,
    moved: Sequence[_Moved],
) -> list[_Witness]:
    """Compute distances (m, or log of a ratio) of further recordings, from the moved markers, else from all."""
    about = {label for marker in moved for label in marker.labels}

    def apart(recording: RecordingContext, reference: RecordingContext) -> float:
        distances = SegmentDistances.of(recording.all_markers, reference.all_markers, marker_set)
        if not moved:
            return abs(float(np.log(distances.ratio()))) if len(distances.pairs) else np.nan
        involved = np.isin(distances.pairs, [k for k, label in enumerate(distances.labels) if label in about]).any(
            axis=1
        )
        return float(np.abs(distances.differences()[involved]).max()) if involved.any() else np.nan

    return [_Witness(apart(witness, first), apart(witness, other)) for witness in further]


def _called(context: PersonContext, reference: RecordingContext) -> str:
    return "static trial" if reference is context.static else f"standing trial {reference.name}"


def _joined(found: Sequence[Sequence[Finding]]) -> Iterator[Finding]:
    """Merge the same finding against several references into one, with all their names."""
    merged: dict[tuple[str, Where], Finding] = {}
    for reported in (unmerged for of_reference in found for unmerged in of_reference):
        key = reported.code, reported.where
        if key in merged:
            names = Quantity(f"{merged[key].evidence['reference'].value} and {reported.evidence['reference'].value}")
            reported = replace(merged[key], evidence={**merged[key].evidence, "reference": names})
        merged[key] = reported
    yield from merged.values()


@check("S302", "S303")
def repeated_trials(context: PersonContext) -> Iterator[Finding]:
    """Report S302 and S303: two trials whose markers (S302) or forces (S303) are identical over times that overlap."""
    for first, other in combinations(context.trials, 2):
        if not _overlap(first.window_s, other.window_s):
            continue
        recording, other_recording = first.recording, other.recording
        if _same(recording.markers.positions, other_recording.markers.positions):
            code = "S302"
        elif _same_forces(recording, other_recording) and _overlap(_span(recording), _span(other_recording)):
            code = "S303"
        else:
            continue
        yield finding(code, Where(trial=other.name), other_trial=Quantity(first.name))


def _same(positions: np.ndarray, reference: np.ndarray) -> bool:
    return positions.shape == reference.shape and bool(np.array_equal(positions, reference, equal_nan=True))


def _same_forces(first: Recording, other: Recording) -> bool:
    """Return whether both recordings have the same loads; false where they have none."""
    if first.plates is None or other.plates is None or not np.nan_to_num(first.plates.force).any():
        return False
    return _same(first.plates.force, other.plates.force)


def _span(recording: Recording) -> tuple[float, float]:
    """Return first and last time (s) of the markers: pieces of one recording may come with the forces of the whole."""
    return float(recording.markers.time[0]), float(recording.markers.time[-1])


def _overlap(span: Span, second: Span) -> bool:
    return span is None or second is None or (span[0] < second[1] and second[0] < span[1])
