"""Three-dimensional joint moments by OpenSim's positions and velocities of bodies alone, by Newton's and Euler's laws.

The moment of the proximal on the distal segment is what moves the bodies beyond the joint, less gravity and the load on
the foot. Its components are those of `kinertia.motion.joint_moments`, computed here without it: about the flexion axis
of the proximal segment, the long axis of the distal one (a foot's points forward) and the axis perpendicular to both.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import opensim
import pandas as pd

from validation.truth_person import SIDES, Person, array

_STEP_S = 1e-4
_G = np.array([0.0, -9.80665, 0.0])
_RIGHT, _UP, _FORWARD = 2, 1, 0

Course = Callable[[np.ndarray], list[np.ndarray]]
"""A motion: coordinates and first two derivatives at (n,) times, each (n, c)."""


@dataclass(frozen=True)
class TruthJoint:
    """A joint of gait2354, by its bodies.

    Attributes:
        name: as in `joint_moments.sto`: "knee_r".
        parent, child: bodies that the axes belong to.
        centre: body whose origin is the joint's centre.
        beyond: bodies distal to the joint.
        side: of the foot beyond it; "" for none.
        long_axis: of the child.
        signs: of flexion, adduction (bending) and rotation about axes right, forward and up.
    """

    name: str
    parent: str
    child: str
    centre: str
    beyond: tuple[str, ...]
    side: str
    long_axis: int
    signs: tuple[float, float, float]

    @property
    def columns(self) -> tuple[str, str, str]:
        """Names of the components."""
        second = "adduction" if self.side else "bending"
        return f"{self.name}_flexion", f"{self.name}_{second}", f"{self.name}_rotation"


def gait2354_joints() -> list[TruthJoint]:
    """Return hips, knees, ankles and the back."""
    result = []
    for side in SIDES:
        inward = 1.0 if side == "r" else -1.0
        foot = tuple(f"{body}_{side}" for body in ("talus", "calcn", "toes"))
        femur, tibia, talus, calcn = (f"{body}_{side}" for body in ("femur", "tibia", "talus", "calcn"))
        leg = (side, _UP)
        result += [
            TruthJoint(f"hip_{side}", "pelvis", femur, femur, (femur, tibia, *foot), *leg, (1.0, inward, inward)),
            TruthJoint(f"knee_{side}", femur, tibia, tibia, (tibia, *foot), *leg, (-1.0, inward, inward)),
            TruthJoint(f"ankle_{side}", tibia, calcn, talus, foot, side, _FORWARD, (1.0, inward, inward)),
        ]
    return [*result, TruthJoint("lumbar", "pelvis", "torso", "torso", ("torso",), "", _UP, (-1.0, 1.0, 1.0))]


def three_dimensional_moments(person: Person, motion: Course, forces: pd.DataFrame, time: np.ndarray) -> pd.DataFrame:
    """Compute the moments (N m) of all joints at these times.

    Args:
        person: the model.
        motion: its motion.
        forces: forces file of `truth_trials.force_columns`.
        time: (n,) s.
    """
    before, now, after = (motion(time + step) for step in (-_STEP_S, 0.0, _STEP_S))
    loads = _loads(forces, time)
    rows = []
    for k in range(len(time)):
        slow, fast = (_velocities(person, trajectory[0][k], trajectory[1][k]) for trajectory in (before, after))
        needed = {name: (fast[name] - slow[name]) / (2.0 * _STEP_S) for name in fast}
        person.pose(now[0][k], now[1][k])
        load = {side: wrenches[k] for side, wrenches in loads.items()}
        rows.append(_moments(person, needed, load))
    return pd.DataFrame(rows, pd.Index(time, name="time"))


def _loads(forces: pd.DataFrame, time: np.ndarray) -> dict[str, np.ndarray]:
    """Return force and moment about the ground's origin (n, 6) per foot."""
    result = {}
    for side in SIDES:
        force, point, torque = (
            forces[[f"ground_{kind}{axis}" for axis in "xyz"]].to_numpy()
            for kind in (f"force_{side}_v", f"force_{side}_p", f"torque_{side}_")
        )
        wrench = np.hstack([force, np.cross(point, force) + torque])
        result[side] = np.column_stack([np.interp(time, forces.index, column) for column in wrench.T])
    return result


def _bodies(person: Person) -> list[opensim.Body]:
    bodies = person.model.getBodySet()
    return [bodies.get(k) for k in range(bodies.getSize())]


def _velocities(person: Person, q: np.ndarray, qd: np.ndarray) -> dict[str, np.ndarray]:
    """Return velocity of the centre of mass and angular momentum about it (2, 3) of each body, over mass and 1."""
    person.pose(q, qd)
    result = {}
    for body in _bodies(person):
        velocity = body.getVelocityInGround(person.state)
        turning, moving = array(velocity.get(0)), array(velocity.get(1))
        turned = _rotation(person, body)
        arm = turned @ array(body.getMassCenter())
        result[body.getName()] = np.stack(
            [moving + np.cross(turning, arm), turned @ _inertia(body) @ turned.T @ turning]
        )
    return result


def _inertia(body: opensim.Body) -> np.ndarray:
    (xx, yy, zz), (xy, xz, yz) = array(body.getInertia().getMoments()), array(body.getInertia().getProducts())
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _rotation(person: Person, body: opensim.Body) -> np.ndarray:
    turned = body.getTransformInGround(person.state).R()
    return np.array([[turned.get(row, column) for column in range(3)] for row in range(3)])


def _moments(person: Person, needed: Mapping[str, np.ndarray], load: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return the components of all joints in the person's present pose.

    Args:
        person: the model, posed.
        needed: acceleration of the centre of mass and rate of angular momentum (2, 3) per body.
        load: (6,) on each foot.
    """
    places, turns, masses, middles = {}, {}, {}, {}
    for body in _bodies(person):
        name = body.getName()
        places[name], turns[name] = array(body.getTransformInGround(person.state).p()), _rotation(person, body)
        masses[name] = body.getMass()
        middles[name] = places[name] + turns[name] @ array(body.getMassCenter())
    result: dict[str, float] = {}
    for joint in gait2354_joints():
        centre, moment = places[joint.centre], np.zeros(3)
        for name in joint.beyond:
            acceleration, momentum = needed[name]
            moment += momentum + np.cross(middles[name] - centre, masses[name] * (acceleration - _G))
        if joint.side:
            moment -= load[joint.side][3:] - np.cross(centre, load[joint.side][:3])
        first, last = turns[joint.parent][:, _RIGHT], turns[joint.child][:, joint.long_axis]
        floating = np.cross(last, first) if joint.long_axis == _UP else np.cross(first, last)
        floating /= np.linalg.norm(floating)
        axes = (first, floating, last) if joint.long_axis == _UP else (first, last, floating)
        for column, sign, axis in zip(joint.columns, joint.signs, axes, strict=True):
            result[column] = float(sign * axis @ moment)
    return result
