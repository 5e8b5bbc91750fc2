"""An axis along the foot is named; those of models in use, and of people by Isman and Inman, are not."""

from dataclasses import replace

import numpy as np
import pytest

import upright_model as upright
from kinertia.diagnostics.model.geometry import subtalar_axis
from kinertia.io.opensim.reader import read_osim
from kinertia.model.skeleton import Skeleton
from people import with_model
from sound_models import MODELS


def with_axes(right, heading: float = 1.0) -> Skeleton:
    """The upright model with calcanei, whose joints turn about this axis of the right foot, mirrored on the left."""
    skeleton = upright.skeleton()
    joints = []
    for joint in skeleton.joints:
        place = np.asarray(joint.translation) * (heading, 1.0, heading)  # facing backward: turned about the vertical
        if joint.child.startswith("toes"):
            direction = np.asarray(right) * (1.0, 1.0, 1.0 if joint.child.endswith("_r") else -1.0)
            unit = tuple(direction / np.linalg.norm(direction) * (heading, 1.0, heading))
            axes = tuple(replace(axis, direction=unit) for axis in joint.axes)
            joint = replace(joint, child=joint.child.replace("toes", "calcn"), axes=axes)
        joints.append(replace(joint, translation=place))
    return replace(skeleton, joints=tuple(joints))


def isman_and_inman(up_deg: float, inward_deg: float) -> tuple[float, float, float]:
    up, inward = np.radians([up_deg, inward_deg])
    return (np.cos(up) * np.cos(inward), np.sin(up), -np.cos(up) * np.sin(inward))


@pytest.mark.parametrize("heading", [1.0, -1.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("up", "inward"), [(37.5, 8.7), (41, 23), (32, 12), (50, 34), (50, 12), (32, 34)])
def test_people(heading, sign, up, inward):
    """The model's, the mean, and one deviation from it to all sides."""
    axis = sign * np.array(isman_and_inman(up, inward))
    assert list(subtalar_axis(with_model(with_axes(axis, heading), upright.bsp()))) == []


@pytest.mark.parametrize("heading", [1.0, -1.0])
@pytest.mark.parametrize(("axis", "degrees"), [((1, 0, 0), 38), ((0, 1, 0), 53), ((0.79, 0.6, 0.7), 42)])
def test_an_axis_that_was_lost(heading, axis, degrees):
    (finding,) = subtalar_axis(with_model(with_axes(axis, heading), upright.bsp()))
    assert (finding.code, finding.evidence["joints"].value) == ("O304", "talus_r_toes_r, talus_l_toes_l")
    assert np.degrees(finding.evidence["angle_rad"].value) == pytest.approx(degrees, abs=0.6)


@pytest.mark.parametrize("name", MODELS)
def test_models_in_use(file_of, name):
    model = read_osim(file_of(name))
    assert list(subtalar_axis(with_model(model.skeleton, model.bsp))) == []
