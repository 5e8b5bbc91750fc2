"""M10, M11 and M13: is each trajectory visible, intact and precise? Gaps, jumps, frozen, noisy, over-smoothed markers.

A foot swings and lands fast, and the body moves up and down as the forces accelerate it. Both hold in fault-free files
of any laboratory: on 20 measured and synthetic walks and runs, 0.8 to 6 % of the energy of the feet's motion is above 4
Hz (0.4 % once filtered at 6 Hz, 0.02 % and less at 2 Hz), and forces move the body 0.8 to 1.05 times as fast as its
markers show.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.evidence.landmarks import bridged_trajectory
from kinertia.diagnostics.evidence.marker_precision import COARSE_M, NOISY_M
from kinertia.diagnostics.evidence.trajectory_faults import (
    BRIEF_S,
    MOST_SPIKES,
    OFF_M,
    SPIKE_M,
    STEP_M,
    STRAIGHT_M,
    STRAIGHT_S,
    beside_gaps,
    spike_limit_m,
    step_limit_m,
)
from kinertia.diagnostics.runner import NEEDS_LENGTH_UNIT, NEEDS_MEASURED_FRAMES, NEEDS_VELOCITY, check
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.marker_set import in_words
from kinertia.motion.kinematics import LONGEST_BRIDGE_S
from kinertia.trial.data import Markers
from kinertia.trial.marker_quality import visibility
from kinertia.trial.sampled_data import windows

_COINCIDING_M, _COINCIDING_S, _MOSTLY = Limit(0.003, "m"), Limit(0.1, "s"), 0.5
"""The centres of two markers are at least a diameter apart: 4 mm for the smallest."""
_RARE = Limit(0.5)
_DISPENSABLE = ("upper_arm", "forearm")
"""Arms need not be seen."""
_QUICK_HZ, _LEAST_SHARE, _LEAST_SWING_M_S = Limit(4.0, "Hz"), Limit(0.002, usual=(0.008, 0.06)), 1.0
_CERTAIN_SHARE, _QUICK_OF_STANCE = Limit(0.0013), 3.1
"""Share that no fault-free motion has, of 30 (0.008 and more): after a filter at 3 Hz it is 0.0002 to 0.0012. Who
stands longer also swings more slowly: the limit of quick motion in Hz is at most the latter over the stance in s."""
_MOST_RATIO, _RATIO_OF_A_RATE = Limit(1.15, usual=(0.8, 1.05)), 1.8
_RIGID_M = 0.0115
"""Distances between markers of a shank change by up to 10 mm (median over pairs, 2 to 98 %). A filter shortens whatever
turns quickly; a wrong rate does not."""
_MOSTLY_SEEN = 0.9


@check(
    "M111",
    "M112",
    "M113",
    "M114",
    "M115",
    "M116",
    unless=NEEDS_LENGTH_UNIT + NEEDS_MEASURED_FRAMES,
    spike=SPIKE_M,
    brief=BRIEF_S,
    frames=MOST_SPIKES,
    step=STEP_M,
    straight=STRAIGHT_M,
    straight_for=STRAIGHT_S,
    coinciding=_COINCIDING_M,
    coinciding_for=_COINCIDING_S,
)
def trajectories(context: RecordingContext) -> Iterator[Finding]:
    """Report M111 to M116: faults of single trajectories, one finding per marker with spikes, per jump and per filled
    gap; labels of one and the same marker; and frames beside gaps that are left out.
    """
    yield from _coinciding(context)
    yield from _beside_gaps(context)
    faults, rate_hz = context.trajectory_faults, context.markers.rate_hz
    for spikes in faults.spikes:
        yield finding(
            "M111",
            context.at(markers=(spikes.label,), span_s=spikes.span_s),
            Severity.ERROR if spikes.far_frames > MOST_SPIKES else None,
            distance_m=Quantity(spikes.distance_m, "m", limit=spike_limit_m(rate_hz), usual=SPIKE_M.usual),
            frames=Quantity(float(spikes.frames), "1"),
            first_s=Quantity(spikes.span_s[0], "s"),
        )
    for jump in faults.jumps:
        yield finding(
            "M112",
            context.at(markers=(jump.label,), span_s=jump.span_s),
            step_m=Quantity(jump.step_m, "m", limit=step_limit_m(rate_hz), usual=STEP_M.usual),
            time_s=Quantity(jump.span_s[1], "s"),
        )
    for filled in faults.filled:
        yield finding(
            "M113" if filled.frozen else "M114",
            context.at(markers=(filled.label,), span_s=filled.span_s),
            span_s=Quantity(filled.span_s[1] - filled.span_s[0], "s"),
            relative_motion_m=Quantity(filled.relative_motion_m, "m", limit=OFF_M),
        )


def _beside_gaps(context: RecordingContext) -> Iterator[Finding]:
    """Report M116: labels of the marker set that another marker has in a frame beside a gap."""
    off = beside_gaps(context.markers)
    for k in np.flatnonzero(off.any(axis=0)):
        label, time = context.markers.labels[k], context.markers.time[off[:, k]]
        if label in context.segment_of_label:
            where = context.at(markers=(label,), span_s=(float(time[0]), float(time[-1])))
            first_s = Quantity(float(time[0]), "s")
            yield finding("M116", where, frames=Quantity(float(len(time)), "1"), first_s=first_s)


def _coinciding(context: RecordingContext) -> Iterator[Finding]:
    """Report M115: pairs of labels of the marker set that coincide for a while."""
    markers = context.markers
    if len(markers.time) < 2:
        return
    used = [k for k, label in enumerate(markers.labels) if label in context.segment_of_label]
    every = max(1, int(_COINCIDING_S * markers.rate_hz / 2))
    some = markers.positions[::every, used]
    for k, column in enumerate(used):
        near = (np.linalg.norm(some[:, k + 1 :] - some[:, k, None], axis=2) < _COINCIDING_M).any(axis=0)
        for other in np.array(used)[k + 1 :][near].tolist():
            apart = np.linalg.norm(markers.positions[:, column] - markers.positions[:, other], axis=1)
            same = np.asarray(apart < _COINCIDING_M)
            span_s = windows(markers.time, same)[0]
            if span_s[1] - span_s[0] >= _COINCIDING_S:
                yield finding(
                    "M115",
                    context.at(markers=(markers.labels[column], markers.labels[other]), span_s=span_s),
                    Severity.ERROR if same.sum() > _MOSTLY * np.isfinite(apart).sum() else None,
                    distance_m=Quantity(float(np.median(apart[same])), "m", limit=_COINCIDING_M),
                )


@check("M101", "M102", "M103", "M104", rare=_RARE, gap=Limit(LONGEST_BRIDGE_S, "s"))
def visible(context: RecordingContext) -> Iterator[Finding]:
    """Report M101 to M104: one finding per marker (M102 and M103 over the measured window), M104 one per bare
    segment."""
    for marker in visibility(context.markers):
        if marker.share == 0.0:
            yield finding("M101", context.at(markers=(marker.label,)), share=Quantity(0.0, "1"))
    for marker in visibility(_in_window(context)):
        where = context.at(markers=(marker.label,))
        if 0.0 < marker.share < _RARE:
            yield finding("M102", where, share=Quantity(marker.share, "1", limit=_RARE))
        elif marker.share > 0.0 and marker.longest_gap_s > LONGEST_BRIDGE_S:
            yield finding("M103", where, gap_s=Quantity(marker.longest_gap_s, "s", limit=LONGEST_BRIDGE_S))
    yield from _bare_segments(context)


def _in_window(context: RecordingContext) -> Markers:
    """Return the frames that a fit would use; those around loads on plates where they are unknown."""
    windows = () if context.trial is None else context.trial.windows()
    return context.markers.cut(*windows[0]) if windows else context.measured_markers


def _bare_segments(context: RecordingContext) -> Iterator[Finding]:
    """Report M104: pelvis, legs, feet without markers, the trunk if the static trial shows it; of an OpenSim model,
    feet."""
    marker_set = context.marker_set
    if marker_set is None:
        return
    trunk = set(marker_set.segments.get("torso", ()))
    markers = context.measured_markers
    seen = {label for label, shown in zip(markers.labels, markers.seen.T, strict=True) if shown.any()}
    trunk_known = context.static is not None and trunk & context.static.seen_labels
    for segment, labels in marker_set.segments.items():
        if marker_set.landmarks:
            needed = bool(labels) and not segment.startswith(_DISPENSABLE) and (segment != "torso" or trunk_known)
        else:
            needed = segment in ("foot_r", "foot_l")
        if needed and not set(labels) & seen:
            expected = ", ".join(labels) or "markers of the model"
            count = Quantity(float(len(labels)), "1")
            yield finding("M104", context.at(part=in_words(segment)), expected=count, labels=Quantity(expected))


@check("M105")
def absent_markers(context: PersonContext) -> Iterator[Finding]:
    """Report M105: markers of the static trial, or else of the model, that a trial lacks."""
    if context.marker_set is None:
        return
    reference = [label for labels in context.marker_set.segments.values() for label in labels]
    if context.model is None:
        shown = {label for recording in context.standing[:1] for label in recording.all_markers.labels}
        reference = [label for label in reference if label in shown]
    for trial in context.trials:
        absent = tuple(label for label in reference if label not in trial.all_markers.labels)
        if absent:
            yield finding("M105", Where(trial=trial.name, markers=absent), count=Quantity(len(absent), "1"))


@check("M131", "M132", unless=NEEDS_LENGTH_UNIT + NEEDS_MEASURED_FRAMES, coarse=COARSE_M, noisy=NOISY_M)
def precision(context: RecordingContext) -> Iterator[Finding]:
    """Report M131 and M132: coarsely rounded coordinates, and noisy ones."""
    precise = context.marker_precision
    if precise.rounded:
        step = Quantity(precise.step_m, "m", limit=COARSE_M, usual=COARSE_M.usual)
        yield finding("M131", context.at(), step_m=step)
    if precise.noisy:
        noise = Quantity(precise.noise_m, "m", limit=precise.noise_limit_m, usual=NOISY_M.usual)
        yield finding("M132", context.at(), noise_m=noise)


@check("M133", unless=NEEDS_VELOCITY, quick=_QUICK_HZ, share=_LEAST_SHARE, certain=_CERTAIN_SHARE, ratio=_MOST_RATIO)
def over_smoothed(context: RecordingContext) -> Iterator[Finding]:
    """Report M133: markers without the fast part of the motion that the forces show; no finding without steps."""
    trial, owners, changes = context.trial, context.segment_of_label, context.velocity_changes
    if trial is None or changes is None or not context.has_strides:
        return
    share = _quick_share(trial.markers, owners, _quick_hz(context))
    if share is None or share > _LEAST_SHARE:
        return
    ratio = min(changes.vertical_ratio(shown) or 0.0 for shown in (changes.pelvis, changes.centre))
    rigid = ratio > _RATIO_OF_A_RATE and _distances_change_m(trial.markers, owners) < _RIGID_M
    if (ratio >= _MOST_RATIO or share <= _CERTAIN_SHARE) and not rigid:
        yield finding(
            "M133",
            context.at(),
            share=Quantity(share, "1", limit=_LEAST_SHARE, usual=_LEAST_SHARE.usual),
            velocity_ratio=Quantity(ratio, "1", limit=_MOST_RATIO, usual=_MOST_RATIO.usual),
        )


def _quick_hz(context: RecordingContext) -> float:
    """Return the frequency above which motion is quick, lower for somebody whose steps last long."""
    stances = [contact.end_s - contact.start_s for contact in context.contacts if contact.is_step]
    return min(_QUICK_HZ, _QUICK_OF_STANCE / float(np.median(stances))) if stances else _QUICK_HZ


def _quick_share(markers: Markers, owners: Mapping[str, str], quick_hz: float) -> float | None:
    """Return the fast share of the energy of motion, median over swinging feet's markers; None where no foot swings."""
    shares = []
    for k, label in enumerate(markers.labels):
        seen = np.asarray(np.isfinite(markers.positions[:, k]).all(axis=1))
        if not owners.get(label, "").startswith("foot") or seen.mean() < _MOSTLY_SEEN:
            continue
        velocity = np.gradient(bridged_trajectory(markers.time, markers.positions[:, k]), markers.time, axis=0)
        velocity -= velocity.mean(axis=0)
        if np.quantile(np.linalg.norm(velocity, axis=1), 0.95) < _LEAST_SWING_M_S:
            continue
        power = np.square(np.abs(np.fft.rfft(velocity * np.hanning(len(velocity))[:, None], axis=0))).sum(axis=1)
        frequency = np.fft.rfftfreq(len(velocity), 1.0 / markers.rate_hz)
        shares.append(float(power[frequency > quick_hz].sum() / power.sum()))
    return float(np.median(shares)) if shares else None


def _distances_change_m(markers: Markers, owners: Mapping[str, str]) -> float:
    """Return how much (m) the distance of two markers of a shank changes, median of pairs; infinite without a pair."""
    ranges = []
    for side in "rl":
        of_shank = [k for k, label in enumerate(markers.labels) if owners.get(label) == f"shank_{side}"]
        for column, other in combinations(of_shank, 2):
            apart = np.linalg.norm(markers.positions[:, column] - markers.positions[:, other], axis=1)
            apart = apart[np.isfinite(apart)]
            ranges += [float(np.ptp(np.quantile(apart, (0.02, 0.98))))] if apart.size else []
    return float(np.median(ranges)) if ranges else np.inf
