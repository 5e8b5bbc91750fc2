"""What held bodies add to the prior of the body that they move with.

A hand on a welded wrist keeps the model's own parameters, and what the data say of it goes to the forearm. So the
forearm may be farther from the model than a forearm alone: the hand's mass may be another, and the person's wrist is
bent, whatever the model says. To first order, mass dm at d from the body's centre of mass, and a held mass m that moves
by dp, change the body's table by

    mass dm,  centre of mass (d dm + m dp) / M,  inertia dm (d.d - d d^T) + m (2 d.dp - d dp^T - dp d^T).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from kinertia.estimation.prior import SIDES_CORRELATION, BspPrior, with_symmetry
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton

POSTURE_SD_RAD = float(np.radians(20.0))
"""How far the joint of a body that the model holds is from where the model has it."""


def widened(
    prior: BspPrior,
    skeleton: Skeleton,
    own: BodySegmentParameters,
    alone: BspPrior,
    with_it: Mapping[str, Sequence[str]],
) -> BspPrior:
    """The prior of the estimated bodies, each with all that moves with it as one.

    Args:
        prior: of the estimated bodies.
        skeleton: which places the bodies.
        own: the model's own parameters of all bodies.
        alone: prior of all bodies, each on its own.
        with_it: estimated body -> those that are held and move with it.
    """
    rows, covariance = {name: k for k, name in enumerate(own.segments)}, prior.covariance.copy()
    for k, name in enumerate(prior.mean.segments):
        place = slice(10 * k, 10 * k + 10)
        for held in with_it.get(name, ()):
            h = rows[held]
            away = _centre(skeleton, own, held, name) - own.com_m[rows[name]]
            swing = POSTURE_SD_RAD * float(np.linalg.norm(own.com_m[h]))
            sd = np.array([alone.sd[h, 0], *np.hypot(alone.sd[h, 1:4], swing)])
            change = _changes(own.mass_kg[rows[name]], own.mass_kg[h], away) * sd
            covariance[place, place] += change @ change.T
    # a hand's mass, and how its wrist is held, are much alike on both sides, too
    return replace(prior, covariance=with_symmetry(covariance, prior.mean.segments, SIDES_CORRELATION))


def _centre(skeleton: Skeleton, own: BodySegmentParameters, held: str, name: str) -> np.ndarray:
    """(3,) m, centre of mass of the held body in the frame of the body that it moves with."""
    tree = skeleton.tree
    there, here = skeleton.segments.index(held), skeleton.segments.index(name)
    centre = tree.segment_rotation[there] @ own.com_m[own.segments.index(held)] + tree.segment_translation[there]
    result: np.ndarray = tree.segment_rotation[here].T @ (centre - tree.segment_translation[here])
    return result


def _changes(mass_kg: float, held_kg: float, away: np.ndarray) -> np.ndarray:
    """(10, 4) derivatives of a body's table by the mass of a held one, and by the place of its centre of mass."""
    result = np.zeros((10, 4))
    first, second = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    result[0, 0] = 1.0
    result[1:4, 0] = away / mass_kg
    result[1:4, 1:] = held_kg / mass_kg * np.eye(3)
    result[4:, 0] = (away @ away * np.eye(3) - np.outer(away, away))[first, second]
    for axis, along in enumerate(np.eye(3)):
        across = np.outer(away, along)
        result[4:, 1 + axis] = held_kg * (2.0 * away[axis] * np.eye(3) - across - across.T)[first, second]
    return result
