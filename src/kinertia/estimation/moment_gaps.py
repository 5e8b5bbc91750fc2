"""Finds when the joint moments of a leg are not known, and why."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.curve_source import Estimated
from kinertia.estimation.leg_moments import known_legs
from kinertia.motion.kinematics import AROUND_CONTACT_S, near_contacts
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N
from kinertia.trial.plate_assignment import FOOT_NAMES
from kinertia.trial.sampled_time import nearest_samples, runs, span_s

HIDDEN = "markers do not show the leg"
OUTSIDE = "no forces were recorded"
SHARED = "one plate carries both feet"
PARTLY = "the foot reaches beyond its plate, or something else loads the plate"
BESIDE = "the foot stands beside the plates"
FAR = f"more than {AROUND_CONTACT_S} s from any contact with a plate"
ENDS = "too near the ends of the recording for accelerations, or left out"
_SHORTEST_S = 0.03
"""Shorter gaps are not listed."""


@dataclass(frozen=True)
class MomentGap:
    """Time (s) in which the moments of a leg ("r" or "l") are not known, with the reason."""

    side: str
    start_s: float
    end_s: float
    reason: str


def moment_gaps(trial: Estimated) -> tuple[MomentGap, ...]:
    """Return the gaps of the right, then the left leg between the first and the last frame that has any moment."""
    return tuple(_gaps(trial)) if trial.joint_curves is not None else ()


def gaps_sentence(trials: Sequence[Estimated]) -> str:
    """List the gaps by reason: "the foot stands beside the plates (right 1.20 to 1.40 s)"; with several trials by
    trial.
    """
    parts = []
    for trial in trials:
        spans: dict[str, list[str]] = {}
        for one in moment_gaps(trial):
            side = FOOT_NAMES[FEET.index(one.side)]
            spans.setdefault(one.reason, []).append(f"{side} {one.start_s:.2f} to {one.end_s:.2f} s")
        gaps = "; ".join(f"{reason} ({', '.join(own)})" for reason, own in spans.items())
        if gaps:
            parts.append(f"{trial.name}: {gaps}" if len(trials) > 1 else gaps)
    return ". ".join(parts)


def _gaps(trial: Estimated) -> Iterator[MomentGap]:
    k = trial.kinematics
    time, loads, own = k.trial.markers.time, k.trial.loads, k.course_frames
    nearest = nearest_samples(loads.time, time)
    loaded = loads.force[nearest, :, 1] >= LOAD_THRESHOLD_N
    shared = np.zeros(len(time), dtype=bool) if loads.on_shared_plate is None else loads.on_shared_plate[nearest]
    known, measured = known_legs(trial), k.trial.known_legs
    for foot, (side, segment) in enumerate(zip(FEET, trial.skeleton.feet, strict=True)):
        moved = np.unique(trial.skeleton.map.owner[trial.skeleton.support[trial.skeleton.segments.index(segment)]])
        reasons = {
            HIDDEN: ~np.isfinite(k.ik.q[:, moved]).all(axis=1),
            OUTSIDE: (time < loads.time[0]) | (time > loads.time[-1]),
            SHARED: ~measured[:, foot] & shared,
            PARTLY: ~measured[:, foot] & loaded[:, foot],
            BESIDE: ~measured[:, foot],
            FAR: ~near_contacts(k.trial),
        }
        which = np.select([known[:, foot], *reasons.values()], [-1, *range(len(reasons))], len(reasons))[own]
        names = [*reasons, ENDS]
        for number, name in enumerate(names):
            for first, last in runs(which == number):
                if span_s(time[own], first, last) >= _SHORTEST_S:
                    yield MomentGap(side, float(time[own][first]), float(time[own][last]), name)
