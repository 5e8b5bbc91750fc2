import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import upright_model as upright
from kinertia.io.opensim.reader import read_osim
from kinertia.model.anatomy import model_segments, segment_of
from kinertia.model.bsp import BodySegmentParameters
from recordings import here


@pytest.mark.parametrize(
    ("body", "segment"),
    [("pelvis", "pelvis"), ("Femur_R", "thigh_r"), ("patella_l", "thigh_l"), ("tibia_r", "shank_r"),
     ("calcn_l", "foot_l"), ("toes_r", "foot_r"), ("lumbar3", "torso"), ("head_neck", "torso"),
     ("humerus_l", "upper_arm_l"), ("radius_r", "forearm_r"), ("hand_l", "forearm_l"), ("femur", None),
     ("barbell", None)],
)  # fmt: skip
def test_segment_by_name(body, segment):
    assert segment_of(body) == segment


def assert_literature(segments):
    literature = upright.literature()
    for name, row in zip(segments.bsp.segments, segments.bsp.table(), strict=True):
        expected = literature.table()[literature.segments.index(name)]
        np.testing.assert_allclose(row, expected, atol=1e-9, err_msg=name)


def test_segments_come_out_in_the_axes_of_the_literature():
    segments = model_segments(upright.skeleton(), upright.bsp(), upright.HEIGHT_M, upright.SEX)
    assert segments.bsp.segments == upright.literature().segments
    assert segments.bodies["foot_r"] == ("talus_r",)
    assert segments.unknown == ()
    assert_literature(segments)
    wanted = upright.geometry()
    assert segments.geometry.lumbar_joint_m == pytest.approx(wanted.lumbar_joint_m)
    assert segments.geometry.mid_hip_m == pytest.approx(wanted.mid_hip_m)
    assert dict(segments.geometry.lengths_m) == pytest.approx(dict(wanted.lengths_m))


def test_frames_of_bodies_do_not_matter():
    """The same thighs in frames that are turned about z against the line from hip to knee."""
    turn = Rotation.from_euler("z", 20, degrees=True).as_matrix()
    table = upright.bsp()
    com, inertia = table.com_m.copy(), table.inertia_kgm2.copy()
    for side in "rl":
        i = table.segments.index(f"femur_{side}")
        com[i], inertia[i] = turn @ com[i], turn @ inertia[i] @ turn.T
    askew = BodySegmentParameters(table.segments, table.mass_kg, com, inertia)
    assert_literature(model_segments(upright.skeleton(turned=turn), askew, upright.HEIGHT_M, upright.SEX))


def test_bodies_are_put_together():
    """A foot cut into talus and toes weighs and turns like the whole."""
    table = upright.bsp()
    rows = table.table()
    foot = rows[table.segments.index("talus_r")].copy()
    offset = np.array([0.8, -0.6, 0]) * upright.geometry().lengths_m["foot_r"]
    halves = {"talus_r": np.zeros(3), "toes_r": offset}
    for body, origin in halves.items():
        row = foot.copy()
        row[0], row[1:4], row[4:] = foot[0] / 2, foot[1:4] - origin, foot[4:] / 2
        rows[table.segments.index(body)] = row
    segments = model_segments(upright.skeleton(), BodySegmentParameters.from_table(table.segments, rows))
    assert segments.bodies["foot_r"] == ("talus_r", "toes_r")
    assert_literature(segments)


def test_models_without_arms_or_without_known_names():
    segments = model_segments(upright.skeleton(arms=False), upright.bsp(arms=False))
    assert not any("arm" in segment for segment in segments.bsp.segments)
    assert segments.geometry is not None
    names = {"femur_r": "rod_r", "tibia_r": "bar_r"}
    table = upright.bsp()
    renamed = BodySegmentParameters.from_table([names.get(n, n) for n in table.segments], table.table())
    skeleton = upright.skeleton()
    joints = [
        type(j)(names.get(j.parent, j.parent), names.get(j.child, j.child), j.rotation, j.translation, j.axes)
        for j in skeleton.joints
    ]
    segments = model_segments(type(skeleton)("odd", tuple(joints), ()), renamed)
    assert set(segments.unknown) == {"rod_r", "bar_r"}
    assert segments.geometry is None


THIGHS = {
    "synthetic/scaled.osim": "thigh",
    "gait2354/subject01_scaled.osim": "femur",
    "rajagopal_walk/scaled.osim": "femur",
    "subject4/addbiomechanics_scaled.osim": "femur",
}


@pytest.mark.parametrize("name", here(THIGHS))
def test_scaled_models_keep_their_mass_and_whole_body_centre(file_of, name):
    """All bodies have a segment, and femurs, whose frames nearly are the segment's, stay as they are."""
    model = read_osim(file_of(name))
    segments = model_segments(model.skeleton, model.bsp)
    assert segments.unknown == ()
    assert segments.bsp.total_mass_kg == pytest.approx(model.bsp.total_mass_kg)
    femur = model.bsp.segments.index(f"{THIGHS[name]}_r")
    thigh = segments.bsp.segments.index("thigh_r")
    assert segments.bsp.com_m[thigh] == pytest.approx(model.bsp.com_m[femur], abs=0.008)
    assert segments.geometry.lengths_m["thigh_r"] == pytest.approx(segments.geometry.lengths_m["thigh_l"])
