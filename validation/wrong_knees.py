"""Displace the knees of an OpenSim model against markers and hips, as a laboratory does that marks them wrongly.

The knee's centre and flexion axis define the axes of thigh and shank: a centre displaced sideways tilts the long axes
of both, an axis turned about the thigh turns the thigh's axes with it. Markers, centres of mass and the neighbouring
joints stay where they are.
"""

from pathlib import Path

import numpy as np
import opensim
from scipy.spatial.transform import Rotation

from validation.opensim_runs import vector
from validation.truth_person import SIDES, array

CENTRE_M, AXIS_RAD = 0.005, float(np.radians(4.0))
"""Standard deviations of the displacements."""
_STREAM = 78


def displace_knees(path: Path, seed: int) -> None:
    """Displace both knees of a model file at random, to the side and about the thigh."""
    rng = np.random.default_rng([seed, _STREAM])
    model = opensim.Model(str(path))
    state = model.initSystem()
    for side in SIDES:
        centre_m, axis_rad = rng.normal(0.0, (CENTRE_M, AXIS_RAD))
        femur, tibia, talus = (model.getBodySet().get(f"{name}_{side}") for name in ("femur", "tibia", "talus"))
        knee = _origin(tibia, femur, state)
        thigh_m, shank_m = np.linalg.norm(knee), np.linalg.norm(_origin(talus, tibia, state))
        thigh = Rotation.from_euler("XY", [-np.arcsin(centre_m / thigh_m), axis_rad])
        shank = Rotation.from_euler("X", np.arcsin(centre_m / shank_m))
        _redefine(model, femur.getName(), thigh, np.zeros(3))
        _redefine(model, tibia.getName(), shank, thigh.apply(knee) - knee)
        joint = model.updJointSet().get(f"knee_{side}")
        _orient(joint, 0, Rotation.identity(), np.zeros(3))
        _orient(joint, 1, shank.inv() * thigh, np.zeros(3))
    model.finalizeConnections()
    model.printToXML(str(path))


def _origin(body: opensim.Body, frame: opensim.Body, state: opensim.State) -> np.ndarray:
    return array(body.findStationLocationInAnotherFrame(state, vector(np.zeros(3)), frame))


def _redefine(model: opensim.Model, name: str, turn: Rotation, origin: np.ndarray) -> None:
    """Express what is fixed to a body in axes that are turned and displaced within it."""
    body = model.updBodySet().get(name)
    inward = turn.inv()
    body.setMassCenter(vector(inward.apply(array(body.getMassCenter()) - origin)))
    (xx, yy, zz), (xy, xz, yz) = array(body.getInertia().getMoments()), array(body.getInertia().getProducts())
    turned = inward.as_matrix() @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.as_matrix()
    body.setInertia(opensim.Inertia(*np.diag(turned), turned[0, 1], turned[0, 2], turned[1, 2]))
    for k in range(model.getMarkerSet().getSize()):
        marker = model.updMarkerSet().get(k)
        if marker.getParentFrame().getName() == name:
            marker.set_location(vector(inward.apply(array(marker.get_location()) - origin)))
    for k in range(model.getJointSet().getSize()):
        joint = model.updJointSet().get(k)
        for row in (0, 1):
            frame = opensim.PhysicalOffsetFrame.safeDownCast(joint.get_frames(row))
            if frame.getParentFrame().getName() == name:
                old = Rotation.from_euler("XYZ", array(frame.get_orientation()))
                _orient(joint, row, inward * old, inward.apply(array(frame.get_translation()) - origin))


def _orient(joint: opensim.Joint, row: int, turn: Rotation, place: np.ndarray) -> None:
    frame = opensim.PhysicalOffsetFrame.safeDownCast(joint.upd_frames(row))
    frame.set_translation(vector(place))
    frame.set_orientation(vector(turn.as_euler("XYZ")))
