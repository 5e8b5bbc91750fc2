"""Coordinates that stay at an end of their range because the model clamps them, or go beyond what joints do."""

from __future__ import annotations

import numpy as np

from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import InverseKinematics

_AT_END, _BEYOND_RAD = 0.05, np.radians(10.0)
"""Share of the frames, and angle, from which on the user is told of the end of a coordinate's range."""
_CLAMPED = 0.2
"""Share of the frames from which on a clamped coordinate of legs or trunk is a fault of the model: on 30 sound trials
with models of six makers it is 0.08 at most (knees that end straight), in one that clamps knees at 10 degrees 0.33."""


def range_notes(skeleton: Skeleton, ik: InverseKinematics) -> list[str]:
    """Which coordinates stay at an end of their range, or go beyond it, in words."""
    bounds, known, at_end = skeleton.bounds, np.isfinite(ik.q), _shares(skeleton, ik)
    beyond = np.abs(bounds.beyond(np.where(known, ik.q, bounds.clamped(np.zeros_like(ik.q))))).max(axis=0)
    held = [f"{ik.coordinates[c]} ({100 * at_end[c]:.0f} %)" for c in np.flatnonzero(at_end > _AT_END)]
    past = [
        f"{ik.coordinates[c]} ({np.degrees(beyond[c]):.0f} deg)"
        for c in np.flatnonzero((beyond > _BEYOND_RAD) & skeleton.rotational)
    ]
    sentences = []
    if held:
        sentences.append(
            f"before the estimate these coordinates stand at an end of their range, which the model clamps (share of "
            f"the frames): {', '.join(held)}"
        )
    if past:
        sentences.append(f"beyond the usual range of a joint, by at most: {', '.join(past)}")
    return sentences


def clamped_doubts(skeleton: Skeleton, ik: InverseKinematics) -> list[str]:
    """Legs and trunk that the model's ranges keep from where markers show them: then other joints make up for it."""
    at_end = _shares(skeleton, ik)
    central = [skeleton.segments.index(foot) for foot in skeleton.feet]
    central += [k for k, segment in enumerate(skeleton.segments) if segment_of(segment) == "torso"]
    moves = set(skeleton.map.owner[skeleton.support[central].any(axis=0)].tolist())
    held = [c for c in np.flatnonzero(at_end > _CLAMPED).tolist() if c in moves]
    if not held:
        return []
    listed = ", ".join(f"{_range(skeleton, c)}: {100 * at_end[c]:.0f} % of the frames at an end" for c in held)
    return [
        f"the model clamps what the markers show to go on: {listed}; markers, joint centres and plates then make up "
        "for it, and joint moments are wrong: widen these ranges in the model, or clear their <clamped>"
    ]


def _shares(skeleton: Skeleton, ik: InverseKinematics) -> np.ndarray:
    """(c,) share of the frames in which a coordinate stands at an end of its clamped range."""
    bounds, frames = skeleton.bounds, np.maximum(np.isfinite(ik.q).sum(axis=0), 1)
    result: np.ndarray = ((ik.q <= bounds.least) | (ik.q >= bounds.most)).sum(axis=0) / frames
    return result


def _range(skeleton: Skeleton, column: int) -> str:
    """A coordinate and its clamped range: "knee_angle_r, -120 to 10 degrees"."""
    factor, unit = (180.0 / np.pi, "degrees") if skeleton.rotational[column] else (1.0, "m")
    low, high = (factor * float(ends[column]) for ends in (skeleton.bounds.least, skeleton.bounds.most))
    return f"{skeleton.coordinates[column]}, {low:.3g} to {high:.3g} {unit}"
