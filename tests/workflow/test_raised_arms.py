"""Arms that turn about their own axes, as a swing above the head does: the built-in model's shoulders cannot."""

import numpy as np
import pytest

from generic_static import generic_model, smooth_motion
from kinertia.model.anatomy import segment_of
from kinertia.trial.data import FootLoads, Markers, Trial
from kinertia.workflow.built_in_model import calibrate


@pytest.fixture(scope="module")
def swing():
    model = generic_model()
    skeleton = model.skeleton.free(["arm_rot_r", "arm_rot_l"])
    time, motion = smooth_motion(skeleton, 300, 100.0, 0)
    q, column = motion.q.copy(), {name: i for i, name in enumerate(skeleton.coordinates)}
    phase = np.sin(2.0 * np.pi * time / 1.5)
    for side, sign in (("r", 1.0), ("l", -1.0)):
        q[:, column[f"arm_flex_{side}"]] = 0.9 + 0.9 * phase
        q[:, column[f"elbow_flex_{side}"]] = 1.2 + 0.2 * phase
        q[:, column[f"arm_rot_{side}"]] = sign * (0.6 + 0.6 * phase)
    markers = Markers(time, skeleton.labels, skeleton.marker_positions(skeleton.pose(q)))
    zero = np.zeros((len(time), 2, 3))
    return model, Trial("swing", markers, FootLoads(time, zero, zero), np.ones(len(time), bool))


def test_arms_do_not_take_the_trunk_with_them(swing):
    model, trial = swing
    calibrated = calibrate(model, [trial])
    assert calibrated.torso_rotation_rad > 0.25
    arms = {m.label for m in model.skeleton.markers if str(segment_of(m.segment)).startswith(("upper_arm", "forearm"))}
    assert max(away for label, away in calibrated.adaptation.moved_m.items() if label not in arms) < 0.01
