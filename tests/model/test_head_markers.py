"""Markers on the head are found by their height, and left out where three others show the trunk."""

import numpy as np
import pytest

from generic_static import generic_model
from kinertia.model.head_markers import head_markers, without_head
from kinertia.model.skeleton import Marker

ACROMIA = ("R.Acromium", "L.Acromium")


@pytest.fixture(scope="module")
def skeleton():
    """With temples and crown, as they stand, and C7 and two more on the trunk."""
    skeleton = generic_model().skeleton
    shoulder = next(joint.translation[1] for joint in skeleton.joints if joint.child == "upper_arm_r")
    trunk = [m for m in skeleton.markers if m.segment != "torso" or m.label in ("Sternum", *ACROMIA)]
    heights = {"C7": 0.1, "T10": -0.2, "Back": -0.1, "LHD": 0.22, "RHD": 0.23, "Top": 0.36}
    more = [Marker(label, "torso", np.array([0.0, shoulder + height, 0.0])) for label, height in heights.items()]
    return skeleton.with_markers([*trunk, *more])


def test_a_head_is_far_above_the_shoulders(skeleton):
    assert head_markers(skeleton) == ("LHD", "RHD", "Top")
    bare = skeleton.with_markers([m for m in skeleton.markers if m.label not in ("LHD", "RHD", "Top")])
    assert head_markers(bare) == ()
    assert without_head(bare, ACROMIA, bare.labels) == (bare, ())


def test_a_head_is_left_out_where_others_show_the_trunk(skeleton):
    left, head = without_head(skeleton, ACROMIA, skeleton.labels)
    assert head == ("LHD", "RHD", "Top")
    assert set(left.labels) == set(skeleton.labels) - set(head)


def test_a_head_is_needed_beside_acromia_or_where_a_trial_lacks_markers(skeleton):
    worn = set(skeleton.labels) - {"T10", "Back"}
    assert without_head(skeleton, ACROMIA, worn) == (skeleton, ())
    assert without_head(skeleton, (*ACROMIA, "C7", "T10"), skeleton.labels) == (skeleton, ())
