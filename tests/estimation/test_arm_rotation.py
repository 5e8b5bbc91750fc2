"""Arms that swing and rotate, which the model's shoulders follow only if the arms may rotate about their own axes."""

import numpy as np
import pytest

from generic_static import generic_model, smooth_motion
from kinertia.estimation import calibration
from kinertia.estimation.arm_rotation import with_rotating_arms
from kinertia.estimation.calibration import AdaptationInputs, first_poses
from kinertia.model.gait27 import ARM_ROTATIONS, UPPER_ARM_ROTATIONS
from kinertia.trial.data import FootLoads, Markers, Trial


@pytest.fixture(scope="module")
def skeleton():
    """With one marker at each elbow and one at each wrist."""
    whole = generic_model().skeleton
    return whole.with_markers([m for m in whole.markers if not m.label.endswith((".Bicep", ".Wrist.Med"))])


def jump(skeleton, elbows_rad=(0.6, 1.6), rotation_rad=1.2, hidden=False) -> Trial:
    """Both arms swing overhead and rotate, with elbows that bend between two angles; a wrist may be hidden for long."""
    free = skeleton.free(UPPER_ARM_ROTATIONS)
    time, motion = smooth_motion(free, 300, 100.0, 0)
    q, phase = motion.q.copy(), 2.0 * np.pi * time
    for side in "rl":
        for name, angle in (
            ("arm_flex", 0.5 + 2.0 * np.sin(phase)),
            ("arm_add", -0.4 + np.sin(2.0 * phase)),
            ("arm_rot", rotation_rad * np.cos(phase)),
            ("elbow_flex", np.mean(elbows_rad) + 0.5 * np.ptp(elbows_rad) * np.sin(phase + 1.0)),
        ):
            q[:, free.coordinates.index(f"{name}_{side}")] = angle
    positions = free.marker_positions(free.pose(q))
    if hidden:
        positions[100:200, free.labels.index("R.Wrist.Lat")] = np.nan
    zero = np.zeros((len(time), 2, 3))
    return Trial("jump", Markers(time, free.labels, positions), FootLoads(time, zero, zero), np.ones(len(time), bool))


def test_arms_rotate_where_bent_elbows_show_it(skeleton):
    trial = jump(skeleton)
    rotating = with_rotating_arms(skeleton, [trial])
    assert set(UPPER_ARM_ROTATIONS) <= set(rotating.coordinates)
    before, after = (first_poses(one, [trial])[0].marker_rms_m for one in (skeleton, rotating))
    assert before > 0.015
    assert after < 0.001


def test_arms_of_which_a_frame_does_not_show_it_stay_locked(skeleton):
    assert with_rotating_arms(skeleton, [jump(skeleton, (0.0, 0.0))]).coordinates == skeleton.coordinates
    one_sided = with_rotating_arms(skeleton, [jump(skeleton), jump(skeleton, hidden=True)])
    assert "arm_rot_l" in one_sided.coordinates
    assert "arm_rot_r" in one_sided.locked


@pytest.mark.parametrize("rotation_rad", [1.2, 2.0])
def test_adaptation_to_arms_that_the_model_cannot_follow_never_makes_it_worse(skeleton, rotation_rad):
    trial = jump(skeleton, rotation_rad=rotation_rad)
    poses = first_poses(skeleton, [trial])
    sd = {segment: 0.04 if "arm" in segment or segment == "torso" else 0.01 for segment in skeleton.segments}
    adapted = calibration.adapt(
        skeleton, AdaptationInputs([trial], poses, sd, dict.fromkeys(ARM_ROTATIONS, 1.0))
    ).skeleton
    (after,) = first_poses(adapted, [trial])
    assert after.marker_rms_m < poses[0].marker_rms_m
