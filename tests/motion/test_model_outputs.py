"""Clinical angles, moments, forces and powers against the generalised ones that they are made of."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.joint_moments import joint_wrenches, leg_joints
from kinertia.motion.model_outputs import Departures, model_outputs
from kinertia.synthetic.walk import walk, walking_subject

MASS_KG = 70.0


@pytest.fixture(scope="module")
def walked():
    subject = walking_subject()
    made = walk(subject, 1.0, 100.0)
    q = made.motion.q
    spread = SimpleNamespace(
        coordinates=np.full(q.shape, 0.01), moments=np.full(q.shape, 7.0), powers=np.full(q.shape, 14.0)
    )
    return SimpleNamespace(
        skeleton=made.skeleton, bsp=made.bsp, motion=made.motion, foot_loads=made.foot_loads, deviations=spread
    )


def outputs_by_name(walked, convention, motion=None):
    """Outputs by name."""
    moved = walked.motion if motion is None else motion
    found = model_outputs(walked.skeleton, walked.bsp, moved, walked.foot_loads, MASS_KG, convention, walked.deviations)
    return {output.name: output for output in found}


def column(walked, values, name):
    return values[:, walked.skeleton.coordinates.index(name)]


@pytest.mark.parametrize("side", ["R", "L"])
def test_angles_of_the_hip_are_its_coordinates(walked, side):
    outputs = outputs_by_name(walked, "plug-in-gait")
    names = [f"hip_{turn}_{side.lower()}" for turn in ("flexion", "adduction", "rotation")]
    expected = np.degrees([column(walked, walked.motion.q, name) for name in names]).T
    np.testing.assert_allclose(outputs[f"{side}HipAngles"].values, expected, atol=1e-9)
    np.testing.assert_allclose(outputs[f"{side}HipAngles"].sd, np.degrees(0.01), rtol=1e-6)
    knee = np.degrees(column(walked, walked.motion.q, f"knee_angle_{side.lower()}"))
    np.testing.assert_allclose(np.diff(outputs[f"{side}KneeAngles"].values[:, 0]), np.diff(knee), atol=0.02)
    assert np.isnan(outputs[f"{side}KneeAngles"].sd[:, 1:]).all()  # the model's knee bends only


@pytest.mark.parametrize("side", ["R", "L"])
def test_moments_along_the_joints_own_axes_are_generalised_moments(walked, side):
    outputs = outputs_by_name(walked, "isb")
    loads = inverse_dynamics(walked.skeleton, walked.bsp, walked.motion, walked.foot_loads) / MASS_KG
    names = [f"hip_{turn}_{side.lower()}" for turn in ("flexion", "adduction", "rotation")]
    expected = np.stack([column(walked, loads, name) for name in names], axis=1)
    np.testing.assert_allclose(outputs[f"{side}HipMoment"].values, expected, atol=1e-10)
    np.testing.assert_allclose(outputs[f"{side}HipMoment"].sd, 7.0 / MASS_KG, rtol=1e-6)
    knee = column(walked, loads, f"knee_angle_{side.lower()}")
    np.testing.assert_allclose(outputs[f"{side}KneeMoment"].values[:, 0], knee, atol=0.01)
    assert np.isnan(outputs[f"{side}KneeMoment"].sd[:, 1:]).all()


def test_plug_in_gaits_moments_extend(walked):
    """Internal, positive where they extend, abduct and rotate externally, in the distal segment's axes."""
    theirs, ours = outputs_by_name(walked, "plug-in-gait"), outputs_by_name(walked, "isb")
    for joint in ("Hip", "Knee", "Ankle"):
        stated, other = theirs[f"R{joint}Moment"].values[:, 0], ours[f"R{joint}Moment"].values[:, 0]
        assert np.corrcoef(stated, -1000.0 * other)[0, 1] > 0.97
        assert abs(np.polyfit(other, stated, 1)[0] + 1000.0) < 150.0
        for name in (f"R{joint}Moment", f"L{joint}Moment"):
            total = np.linalg.norm(theirs[name].values, axis=1)
            wrench = next(
                load
                for leg, load in joint_wrenches(walked.skeleton, walked.bsp, walked.motion, walked.foot_loads).items()
                if f"{leg.side.upper()}{leg.name}Moment" == name
            )
            np.testing.assert_allclose(total, 1000.0 / MASS_KG * np.linalg.norm(wrench[:, 3:], axis=1), rtol=1e-9)


def test_powers_are_those_of_the_coordinates(walked):
    loads = inverse_dynamics(walked.skeleton, walked.bsp, walked.motion, walked.foot_loads)
    outputs = outputs_by_name(walked, "plug-in-gait")
    for leg in leg_joints(walked.skeleton):
        columns = leg.columns(walked.skeleton)
        power = outputs[f"{leg.side.upper()}{leg.name}Power"]
        expected = (loads * walked.motion.qd)[:, columns].sum(axis=1) / MASS_KG
        tolerance = 0.03 if leg.name == "Ankle" else 1e-9  # the subtalar axis does not pass the ankle centre
        np.testing.assert_allclose(power.values[:, 2], expected, atol=tolerance)
        np.testing.assert_allclose(power.sd[:, 2], 14.0 / MASS_KG * np.sqrt(len(columns)), rtol=1e-9)


def test_errors_of_a_joints_axes_go_together_as_motions_by_chance_do(walked):
    """Talocrural and subtalar angles that make up for each other: SDs of the ankle, against many motions."""
    rng, count = np.random.default_rng(3), 3000
    columns = [walked.skeleton.coordinates.index(f"{name}_angle_r") for name in ("ankle", "subtalar")]
    sd, together = np.array([0.02, 0.03]), np.array([[1.0, -0.8], [-0.8, 1.0]])
    apart = np.zeros((count, walked.motion.q.shape[1]))
    apart[:, columns] = rng.multivariate_normal(np.zeros(2), sd[:, None] * together * sd, count)
    frame = slice(30, 31)
    q = walked.motion.q[frame] + apart
    many = SimpleNamespace(**{**vars(walked), "foot_loads": np.zeros((count, 2, 6)), "deviations": None})
    expected = outputs_by_name(many, "isb", Motion(q, 0 * q, 0 * q))["RAnkleAngles"].values.std(axis=0)
    pose = {name: np.repeat(getattr(walked.motion, name)[frame], 2, axis=0) for name in ("q", "qd", "qdd")}
    spread = np.zeros(pose["q"].shape)
    spread[:, columns] = sd
    drawn = np.repeat(apart[:, None], 2, axis=1)
    deviations = SimpleNamespace(coordinates=spread, moments=spread, powers=spread)

    def stated(departures):
        loads = np.repeat(walked.foot_loads[frame], 2, axis=0)
        told = walked.skeleton, walked.bsp, Motion(**pose), loads, MASS_KG, "isb", deviations, departures
        return {model_output.name: model_output.sd[0] for model_output in model_outputs(*told)}

    joint, alone = stated(Departures(drawn, drawn, drawn)), stated(None)
    np.testing.assert_allclose(joint["RAnkleAngles"], expected, rtol=0.05)
    assert np.abs(alone["RAnkleAngles"] / expected - 1.0).max() > 0.15
    assert joint["RAnklePower"][2] == pytest.approx(np.sqrt(sd @ together @ sd) / MASS_KG, rel=0.05)
    assert alone["RAnklePower"][2] == pytest.approx(np.linalg.norm(sd) / MASS_KG)


def test_both_sides_have_the_same_signs(walked):
    """A pose and its mirror image: right and left exchange their angles."""
    names = walked.skeleton.coordinates
    q = np.zeros((1, len(names)))
    rng = np.random.default_rng(1)
    for k, name in enumerate(names):
        if name.endswith("_r"):
            q[0, k] = rng.uniform(0.1, 0.3)
            q[0, names.index(f"{name[:-2]}_l")] = q[0, k]
    still = Motion(q, np.zeros(q.shape), np.zeros(q.shape))
    few = SimpleNamespace(**{**vars(walked), "foot_loads": np.zeros((1, 2, 6)), "deviations": None})
    for convention in ("plug-in-gait", "isb"):
        outputs, before = (
            outputs_by_name(few, convention, still),
            outputs_by_name(few, convention, Motion(0 * q, 0 * q, 0 * q)),
        )
        for joint in ("Hip", "Knee", "Ankle", "FootProgress"):
            turned = [outputs[f"{side}{joint}Angles"].values - before[f"{side}{joint}Angles"].values for side in "RL"]
            np.testing.assert_allclose(*turned, atol=3.0)  # a person's legs are not quite mirror images
            assert np.abs(turned[0]).max() > 5.0


def test_a_model_without_legs_as_these_has_none(walked):
    assert (
        model_outputs(
            walked.skeleton.__class__("stump", walked.skeleton.joints[:2], (), walked.skeleton.locked),
            walked.bsp,
            walked.motion,
            walked.foot_loads,
            MASS_KG,
            "isb",
        )
        == []
    )
