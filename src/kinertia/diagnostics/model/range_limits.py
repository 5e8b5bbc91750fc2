"""Do the model's ranges of motion keep coordinates from the values that the markers show?"""

from collections.abc import Iterator

import numpy as np

from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Skeleton
from kinertia.motion.inverse_kinematics import InverseKinematics

AT_LIMIT, BEYOND_RAD = Limit(0.05), Limit(np.radians(10.0), "rad")
"""Share of the frames, and angle, from which on a limit of a coordinate's range is reported."""
CLAMPED = Limit(0.2, usual=(0.0, 0.08))
"""Share of the frames from which on a clamped coordinate of legs or trunk is a fault of the model: on 30 fault-free
trials with models of six makers it is 0.08 at most (knees that end straight), in one that clamps knees at 10 degrees
0.33."""


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
