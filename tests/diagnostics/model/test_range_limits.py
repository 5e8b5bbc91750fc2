"""A model that clamps a knee where its owner straightens it is named; knees that end straight are not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.model.range_limits import range_findings
from kinertia.model.coordinate_range import Range
from kinertia.synthetic.walk import walk, walking_subject


@pytest.fixture(scope="module")
def trial():
    return walk(walking_subject())


def clamped(trial, name, low, high):
    """The skeleton with this range (degrees), and what inverse kinematics makes of the walk."""
    bounded = Range(np.radians(low), np.radians(high), clamped=True)
    skeleton = replace(trial.skeleton, ranges={**trial.skeleton.ranges, name: bounded})
    q = skeleton.bounds.clamped(trial.motion.q)
    return skeleton, SimpleNamespace(q=q, coordinates=skeleton.coordinates)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("knee_angle_r", 20.0, 120.0), ("subtalar_angle_l", -0.3, 0.3), ("lumbar_rotation", -1.0, 1.0)],
)
def test_legs_and_trunk_that_the_model_holds_back(trial, name, low, high):
    skeleton, ik = clamped(trial, name, low, high)
    found = list(range_findings(skeleton, ik))
    assert [(one.code, one.where.part) for one in found[:2]] == [("O311", name), ("O312", name)]
    assert found[0].evidence["range_rad"].value == pytest.approx(np.radians((low, high)))
    assert found[0].evidence["share"].value > 0.2


def test_sound_ranges_and_arms_are_not_doubted(trial):
    straight = np.degrees(np.quantile(trial.motion.q[:, trial.skeleton.coordinates.index("knee_angle_r")], 0.08))
    for name, low, high in (("knee_angle_r", -10.0, 120.0), ("knee_angle_r", straight, 120.0), ("arm_add_l", 5.0, 6.0)):
        skeleton, ik = clamped(trial, name, low, high)
        assert [one for one in range_findings(skeleton, ik) if one.code == "O311"] == []


def test_a_coordinate_beyond_its_usual_range(trial):
    """Of a joint that nothing clamps."""
    knee = trial.motion.q[:, trial.skeleton.coordinates.index("knee_angle_r")]
    most = float(knee.max() - np.radians(20.0))
    usual = Range(float(knee.min() - 0.1), most, clamped=False, stated=True)
    skeleton = replace(trial.skeleton, ranges={**trial.skeleton.ranges, "knee_angle_r": usual})
    found = [
        one for one in range_findings(skeleton, SimpleNamespace(q=trial.motion.q, coordinates=skeleton.coordinates))
    ]
    (one,) = (each for each in found if each.where.part == "knee_angle_r")
    assert one.code == "O312"
    assert np.degrees(one.evidence["beyond_rad"].value) == pytest.approx(20.0, abs=0.1)
