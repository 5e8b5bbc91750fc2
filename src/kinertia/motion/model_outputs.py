"""Computes angles, moments, forces and powers of the legs as in clinical software, with equal signs on both sides.

Every output has three components. "plug-in-gait" is Vicon's convention. Angles (deg): Cardan sequence flexion,
adduction, rotation. Moments (N mm/kg) are internal, in the axes of the distal segment, positive where they extend,
abduct or rotate externally; forces (N/kg) act from the proximal on the distal segment, in its axes (forward, left, up;
for the foot down, left, forward). Powers (W/kg) are the third component.

"isb" (Wu et al. 2002, J Biomech 35:543) has the same angles except for the pelvis, whose backward tilt and lower side
are positive. Moments (N m/kg) are internal, about the axes of the angles (flexion of the parent, floating, long axis of
the child), and have the signs of the angles; forces (N/kg) are in the distal segment's axes x, y, z.

Signs are equal on both sides: anterior tilt, the side up, internal rotation, flexion, adduction and dorsiflexion are
positive. Angles of pelvis and foot are relative to the direction of the stride. Segments are the model's: compared with
Vicon's own angles, from markers frame by frame, curves have the same shape and constant offsets (flexion of the hip by
up to 13 degrees).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Pose, Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.joint_moments import BodyJoint, axes_alike, component_signs, joint_axes, joint_wrenches, leg_joints
from kinertia.trial.data import FEET

Convention = Literal["plug-in-gait", "isb"]
Kind = Literal["ANGLES", "FORCES", "MOMENTS", "POWERS"]
_SINGULAR = {"ANGLES": "Angles", "FORCES": "Force", "MOMENTS": "Moment", "POWERS": "Power"}
CONVENTIONS: tuple[Convention, ...] = get_args(Convention)
UNITS: dict[Convention, dict[str, str]] = {
    "plug-in-gait": {"ANGLES": "deg", "FORCES": "N", "MOMENTS": "Nmm", "POWERS": "W"},
    "isb": {"ANGLES": "deg", "FORCES": "N", "MOMENTS": "Nm", "POWERS": "W"},
}
"""Units as Vicon writes them; forces, moments and powers are per kg of body mass."""
_STEP_RAD = 1e-5
_UNMOVED = 0.2
"""An angle that no coordinate changes by more has no standard deviation: the model fixes it."""
_OUT_OF_REACH = 0.5
"""A moment has no standard deviation either along a direction that is farther (sine) from the plane of the free axes:
30 degrees. Ankle flexion is up to 20 degrees from it, directions that the model fixes are at 45 and more."""


class Deviations(Protocol):
    """Interface of standard deviations at n frames, as in `CurveDeviations`."""

    @property
    def coordinates(self) -> np.ndarray:
        """Standard deviations (n, c) of coordinates, rad, m."""

    @property
    def moments(self) -> np.ndarray:
        """Standard deviations (n, c) of moments, N m."""

    @property
    def powers(self) -> np.ndarray:
        """Standard deviations (n, c) of powers, W."""


@dataclass(frozen=True, eq=False)
class Departures:
    """Differences of m possible motions from the estimate at n frames, which show how a joint's errors are correlated.

    Attributes:
        coordinates, moments, powers: (m, n, c) as in `Deviations`.
    """

    coordinates: np.ndarray
    moments: np.ndarray
    powers: np.ndarray


@dataclass(frozen=True, eq=False)
class ModelOutput:
    """One output quantity over n frames.

    Attributes:
        joint: "Hip", "Knee", "Ankle", "Pelvis" or "FootProgress".
        side: "r" or "l".
        kind: angles, forces, moments or powers.
        values: (n, 3) in the convention's units.
        sd: (n, 3) standard deviations; NaN where there is none.
    """

    joint: str
    side: str
    kind: Kind
    values: np.ndarray
    sd: np.ndarray

    @property
    def name(self) -> str:
        """Vicon's name of the output: "LHipAngles"."""
        return f"{self.side.upper()}{self.joint}{_SINGULAR[self.kind]}"


def model_outputs(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    motion: Motion,
    foot_loads: np.ndarray,
    mass_kg: float,
    convention: Convention,
    deviations: Deviations | None = None,
    departures: Departures | None = None,
) -> list[ModelOutput]:
    """Compute all outputs of the legs and the pelvis; none unless the legs are hip, knee and ankle in ISB's axes.

    Args:
        skeleton, bsp, motion, foot_loads: as in `joint_wrenches`; the person faces +X.
        mass_kg: of the body.
        convention: signs, axes and units.
        deviations: standard deviations of coordinates, moments and powers, or None.
        departures: show correlations of a joint's axes; if None, their errors are assumed independent.
    """
    joints = leg_joints(skeleton)
    if not joints or not axes_alike(skeleton, joints):
        return []
    wrenches = joint_wrenches(skeleton, bsp, motion, foot_loads)
    pose, clinical = skeleton.pose(motion.q), convention == "plug-in-gait"
    spread = _NoDeviations(motion.q) if deviations is None else deviations
    found = _of_pelvis_and_feet(skeleton, pose, clinical, np.eye(3))
    for joint, wrench in wrenches.items():
        child, parent = _rotation(skeleton, pose, joint.child), _rotation(skeleton, pose, joint.parent)
        columns, signs = joint.columns(skeleton), component_signs(joint)
        by_angle, turning = _moved(skeleton, motion.q, joint, columns)
        together = None if departures is None else departures.coordinates[..., columns]
        sd = np.degrees(_reached(by_angle, _covariance(spread.coordinates[:, columns], together)))
        found.append(ModelOutput(joint.name, joint.side, "ANGLES", np.degrees(signs * _cardan(parent, child)), sd))
        axes = child.swapaxes(1, 2)[:, [2, 0, 1]] if clinical else joint_axes(parent, child)
        factor = (-1000.0 if clinical else 1.0) / mass_kg
        together = None if departures is None else departures.moments[..., columns]
        sd = abs(factor) * _along(axes, turning, _covariance(spread.moments[:, columns], together))
        moment = factor * signs * np.einsum("nak,nk->na", axes, wrench[:, 3:])
        found.append(ModelOutput(joint.name, joint.side, "MOMENTS", moment, sd))
        force = np.einsum("nka,nk->na", child, wrench[:, :3]) / mass_kg
        force = _as_vicon(joint, force) if clinical else force
        found.append(ModelOutput(joint.name, joint.side, "FORCES", force, np.full(force.shape, np.nan)))
        rate = np.einsum("nka,na->nk", turning, motion.qd[:, columns])
        power = np.einsum("nk,nk->n", wrench[:, 3:], rate) / mass_kg
        together = None if departures is None else departures.powers[..., columns]
        sd = _root(_covariance(spread.powers[:, columns], together).sum(axis=(1, 2))) / mass_kg
        found.append(ModelOutput(joint.name, joint.side, "POWERS", _third(power), _third(sd)))
    return found


def plug_in_gait_angles(skeleton: Skeleton, q: np.ndarray, heading_rad: np.ndarray) -> dict[str, np.ndarray]:
    """Compute angles (n, 3) deg by Vicon's name, "LHipAngles", as in `model_outputs` without standard deviations.

    Angles of pelvis and feet are relative to the direction of gait. Empty for a model for which `model_outputs` is
    empty.

    Args:
        skeleton: the model.
        q: (n, c) coordinates, rad and m.
        heading_rad: (n,) direction of gait, from ground's X axis to the left.
    """
    joints = leg_joints(skeleton)
    if not joints or not axes_alike(skeleton, joints):
        return {}
    pose = skeleton.pose(q)
    found = _of_pelvis_and_feet(skeleton, pose, True, Rotation.from_euler("Y", heading_rad[:, None]).as_matrix())
    angles = {output.name: output.values for output in found}
    for joint in joints:
        parent, child = (_rotation(skeleton, pose, segment) for segment in (joint.parent, joint.child))
        angles[f"{joint.side.upper()}{joint.name}Angles"] = np.degrees(component_signs(joint) * _cardan(parent, child))
    return angles


class _NoDeviations:
    """Standard deviations that are NaN throughout."""

    def __init__(self, q: np.ndarray) -> None:
        self.coordinates = self.moments = self.powers = np.full(q.shape, np.nan)


def _rotation(skeleton: Skeleton, pose: Pose, segment: str) -> np.ndarray:
    return pose.rotation[:, skeleton.segments.index(segment)]


def _cardan(parent: np.ndarray, child: np.ndarray) -> np.ndarray:
    """Return rotations (n, 3) rad about z of the parent, the floating axis x, and y of the child (n, 3, 3)."""
    result: np.ndarray = Rotation.from_matrix(parent.swapaxes(-1, -2) @ child).as_euler("ZXY")
    return result


def _moved(
    skeleton: Skeleton, q: np.ndarray, joint: BodyJoint, columns: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the change of the joint's angles (n, 3, k) and the rotation of the child in ground (n, 3, k).

    Both are per unit of the joint's own coordinates.
    """
    angles, turns = np.empty((len(q), 3, len(columns))), np.empty((len(q), 3, len(columns)))
    for k, column in enumerate(columns):
        step = np.zeros(q.shape[1])
        step[column] = _STEP_RAD
        poses = [skeleton.pose(q + sign * step) for sign in (1.0, -1.0)]
        children = [_rotation(skeleton, pose, joint.child) for pose in poses]
        after, before = (
            np.unwrap(_cardan(_rotation(skeleton, pose, joint.parent), child), axis=0)
            for pose, child in zip(poses, children, strict=True)
        )
        angles[..., k] = (after - before) / (2.0 * _STEP_RAD)
        turn = Rotation.from_matrix(children[0] @ children[1].swapaxes(1, 2)).as_rotvec()
        turns[..., k] = turn / (2.0 * _STEP_RAD)
    return angles, turns


def _covariance(sd: np.ndarray, departures: np.ndarray | None) -> np.ndarray:
    """Return covariances (n, k, k) from SDs (n, k) and the correlations of departures (m, n, k), if there are any."""
    if departures is None:
        alone: np.ndarray = np.eye(sd.shape[1]) * np.square(sd)[:, None]
        return alone
    products = np.einsum("mni,mnj->nij", departures, departures)
    sd_of_products = np.sqrt(np.maximum(np.einsum("nii->ni", products), np.finfo(float).tiny))
    result: np.ndarray = (
        products / (sd_of_products[:, :, None] * sd_of_products[:, None]) * sd[:, :, None] * sd[:, None]
    )
    return result


def _root(variance: np.ndarray) -> np.ndarray:
    result: np.ndarray = np.sqrt(np.maximum(variance, 0.0))
    return result


def _reached(by_angle: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return SDs (n, 3) of angles from the coordinates' covariance (n, k, k); NaN for an angle that none changes."""
    moved = np.abs(by_angle).sum(axis=2).max(axis=0) > _UNMOVED
    variance = np.einsum("nai,nij,naj->na", by_angle, covariance, by_angle)
    return np.where(moved, _root(variance), np.nan)


def _along(axes: np.ndarray, turning: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return SDs (n, 3) of a moment along axes (n, 3, 3), from its covariance (n, k, k) in free directions.

    The free directions are `turning` (n, 3, k).
    """
    shares = np.linalg.pinv(turning) @ axes.swapaxes(1, 2)
    rest = np.linalg.norm(turning @ shares - axes.swapaxes(1, 2), axis=1)
    variance = np.einsum("nia,nij,nja->na", shares, covariance, shares)
    return np.where(rest.max(axis=0) < _OUT_OF_REACH, _root(variance), np.nan)


def _as_vicon(joint: BodyJoint, force: np.ndarray) -> np.ndarray:
    """Return components (n, 3) along x, y, z of a segment in Vicon's order and signs; its foot points along z."""
    x, y, z = force.T
    return np.column_stack([-y, -z, x] if joint.name == "Ankle" else [x, -z, y])


def _of_pelvis_and_feet(skeleton: Skeleton, pose: Pose, clinical: bool, ground: np.ndarray) -> list[ModelOutput]:
    """Compute angles of pelvis and feet relative to axes (3, 3) or (n, 3, 3): forward, up and right in columns.

    They have no standard deviations, since they depend on several coordinates together.
    """
    found = []
    for side, foot in zip(FEET, skeleton.feet, strict=True):
        mirrored = 1.0 if side == "r" else -1.0
        pelvis = np.degrees(_cardan(ground, _rotation(skeleton, pose, skeleton.segments[0])))
        pelvis = pelvis * [-1.0, -mirrored, mirrored] if clinical else pelvis * [1.0, mirrored, mirrored]
        found.append(ModelOutput("Pelvis", side, "ANGLES", pelvis, np.full(pelvis.shape, np.nan)))
        angles = np.degrees(_cardan(ground, _rotation(skeleton, pose, foot))) * [1.0, mirrored, mirrored]
        if clinical:
            angles[:, 0] = -angles[:, 0] - 90.0
        found.append(ModelOutput("FootProgress", side, "ANGLES", angles, np.full(angles.shape, np.nan)))
    return found


def _third(values: np.ndarray) -> np.ndarray:
    """Return (n, 3) with a scalar in the third component, as in Vicon's files."""
    return np.column_stack([np.zeros(len(values)), np.zeros(len(values)), values])


class ClinicalAngle(NamedTuple):
    """One of the nine angles: its title, and the joint and component of the Vicon output that it equals."""

    title: str
    joint: str
    component: int


CLINICAL_ANGLES = {
    "pelvis_tilt_clinical": ClinicalAngle("pelvic tilt", "Pelvis", 0),
    "pelvis_obliquity_clinical": ClinicalAngle("pelvic obliquity", "Pelvis", 1),
    "pelvis_rotation_clinical": ClinicalAngle("pelvic rotation", "Pelvis", 2),
    "hip_flexion_clinical": ClinicalAngle("hip flexion", "Hip", 0),
    "hip_adduction_clinical": ClinicalAngle("hip adduction", "Hip", 1),
    "hip_rotation_clinical": ClinicalAngle("hip rotation", "Hip", 2),
    "knee_flexion_clinical": ClinicalAngle("knee flexion", "Knee", 0),
    "ankle_dorsiflexion_clinical": ClinicalAngle("ankle dorsiflexion", "Ankle", 0),
    "foot_progression_clinical": ClinicalAngle("foot progression", "FootProgress", 2),
}
"""The nine angles by their quantity in `cycles.csv` and norms."""


def clinical_angles(skeleton: Skeleton, q: np.ndarray, heading_rad: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    """Compute the clinical angles (n,) deg of each side ("r", "l"), by quantity; NaN where coordinates from ground to
    foot are NaN.

    None for a model without legs of hip, knee and ankle in ISB's axes.

    Args:
        skeleton: the model.
        q: (n, c) coordinates, rad and m.
        heading_rad: (n,) direction of the strides, from ground's X axis to the left.
    """
    outputs = plug_in_gait_angles(skeleton, np.where(np.isfinite(q), q, 0.0), heading_rad)
    result: dict[str, dict[str, np.ndarray]] = {side: {} for side in FEET}
    for side, name in zip(FEET, skeleton.feet, strict=True) if outputs else ():
        foot = skeleton.segments.index(name)
        known = np.isfinite(q[:, np.unique(skeleton.map.owner[skeleton.support[foot]])]).all(axis=1)
        for quantity, angle in CLINICAL_ANGLES.items():
            values = outputs[f"{side.upper()}{angle.joint}Angles"][:, angle.component]
            result[side][quantity] = np.where(known, values, np.nan)
    return result
