"""Does the left of a model mirror its right? Finds the joint of one side that has the frames of the other side.

A pair of joints is compared in ground axes and in the axes of the bodies that carry them, and the better of the two
counts: the axes of bodies may be chosen freely on each side, and a skewed joint further up is not the fault of this
one. Differences in position that the lengths of the two segments explain are subtracted.
"""

import re
from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.person_context import PersonContext
from kinertia.findings.finding import Finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.bsp import FloatArray
from kinertia.model.neutral_joints import NeutralJoints, angle_deg, mirrored, neutral_joints

_AXIS_RAD = float(np.radians(5.0))
"""Fault-free models: 0.0 degrees. The left subtalar joint with the right one's frames: 13.9."""
_POSITION_M = 0.015
"""Fault-free models: 0.0 mm; their segments differ in length by up to 10 mm. A talus whose offset has the other side's
sign: 18 mm."""


def mirrored_joints(context: PersonContext) -> Iterator[Finding]:
    """Report O302 and O303: axes (O302) and positions (O303) of joints whose left and right do not mirror each other.

    A position changes the sign of z in its mirror image, a direction or orientation those of x and y.
    """
    neutral = None if context.model is None else neutral_joints(context.model.skeleton)
    if neutral is None or neutral.sideways is None:
        return
    for pair in neutral.pairs:
        for first, second, angle in _axis_angles(neutral, pair, neutral.sideways):
            if angle > _AXIS_RAD:
                angle_rad = Quantity(angle, "rad", limit=_AXIS_RAD, usual=(0.0, 0.0))
                yield _finding("O302", first, second, angle_rad=angle_rad)
    for right, left in neutral.pairs:
        distance = _mismatch_m(neutral, right, left, neutral.sideways)
        if distance > _POSITION_M:
            distance_m = Quantity(distance, "m", limit=_POSITION_M, usual=(0.0, 0.010))
            yield _finding("O303", right, left, distance_m=distance_m)


def _finding(code: str, right: str, left: str, **measured: Quantity) -> Finding:
    evidence = {**measured, "right": Quantity(right), "left": Quantity(left)}
    return with_evidence(code, Where(part=without_side(right)), evidence)


def _axis_angles(neutral: NeutralJoints, pair: tuple[str, str], sideways: int) -> Iterator[tuple[str, str, float]]:
    """Yield coordinates of the right and left joint, and the angle (rad) of one axis from the other's mirror image."""
    right, left = pair
    others = {without_side(name): name for name in neutral.turns[left]}
    for name, axis in neutral.turns[right].items():
        other = others.get(without_side(name))
        if other is not None:
            angles = [
                angle_deg(turn.T @ axis, reflection @ back.T @ neutral.turns[left][other])
                for turn, back, reflection in _views(neutral, right, left, sideways)
            ]
            yield name, other, float(np.radians(min(angles)))


def _mismatch_m(neutral: NeutralJoints, right: str, left: str, sideways: int) -> float:
    """Return how far (m) the right joint is from the left one's mirror image, each in its own parent.

    Zero where the parents are not each other's: one knee of a model may have more bodies than the other.
    """
    parents = [neutral.joints[name].parent for name in (right, left)]
    if "ground" in parents or (parents[0] != parents[1] and tuple(parents) not in neutral.pairs):
        return 0.0
    apart = []
    for turn, back, reflection in _views(neutral, right, left, sideways):
        if parents[0] == parents[1]:
            apart.append(_in_one_parent(neutral, right, left, (turn, reflection)))
            continue
        vectors = [
            frame.T @ (neutral.centres[name] - neutral.centres[parent])
            for frame, name, parent in zip((turn, back), (right, left), parents, strict=True)
        ]
        lengths = [float(np.linalg.norm(vector)) for vector in vectors]
        if min(lengths) < 1e-6:
            return max(lengths)
        directions = vectors[0] / lengths[0] - reflection @ vectors[1] / lengths[1]
        apart.append(float(np.linalg.norm(directions)) * sum(lengths) / 2)
    return min(apart)


def _in_one_parent(neutral: NeutralJoints, right: str, left: str, view: tuple[FloatArray, FloatArray]) -> float:
    """Return the asymmetry (m) of two joints of one body about its unpaired joints, else about their own middle."""
    turn, reflection = view
    parent = neutral.joints[right].parent
    first, second = (turn.T @ (neutral.centres[name] - neutral.origins[parent]) for name in (right, left))
    across = reflection.diagonal() < 0
    middle = [
        (turn.T @ (neutral.centres[name] - neutral.origins[parent]))[across]
        for name, joint in neutral.joints.items()
        if joint.parent == parent and not name.endswith(("_r", "_l"))
    ]
    apart = first - reflection @ second
    apart[across] -= 2 * np.mean(middle) if middle else apart[across]
    return float(np.linalg.norm(apart))


def _views(
    neutral: NeutralJoints, right: str, left: str, sideways: int
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield viewing axes at the right and left joint and the reflection between them: ground's, then the parents'."""
    yield np.eye(3), np.eye(3), mirrored(sideways)
    first, second = (neutral.joints[name].parent for name in (right, left))
    if "ground" not in (first, second):
        turn, back = neutral.rotations[first], neutral.rotations[second]
        yield turn, back, mirrored(int(np.abs(turn[sideways]).argmax()))


def without_side(coordinate: str) -> str:
    """Return the name that both sides have in common."""
    return re.sub(r"_[rl](?=_|$)", "", coordinate)
