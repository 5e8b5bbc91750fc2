from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import OsimError, SubjectError, TrialError
from kinertia.estimation.prepare import TrialInput
from kinertia.estimation.prepare_osim import at_mass, kind_of, parted, prepare_osim, with_centre_offsets
from kinertia.estimation.prior import MASS_SD, OTHER_MASS_SD
from kinertia.io.osim.reader import read_osim
from kinertia.io.recording import read_recording
from kinertia.io.trc import read_trc
from kinertia.model.centre_offsets import centre_offsets
from kinertia.model.imported import OsimModel
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.settings import Settings, Subject

SUBJECT = Subject(name="A", mass_kg=72.6)


@pytest.fixture(scope="module")
def gait2354(measured_folder) -> OsimModel:
    return read_osim(measured_folder / "gait2354" / "subject01_scaled.osim")


@pytest.fixture(scope="module")
def rajagopal(measured_folder) -> OsimModel:
    return read_osim(measured_folder / "rajagopal_walk" / "scaled.osim")


@pytest.fixture(scope="module")
def walk(measured_folder):
    folder = measured_folder / "gait2354"
    return read_recording(*(folder / f"subject01_walk1{end}" for end in (".trc", "_grf.mot", "_grf.xml")))


@pytest.fixture(scope="module")
def prepared(gait2354, walk):
    return prepare_osim(SUBJECT, gait2354, [TrialInput(walk)], Settings(), False)


def without(recording, labels):
    kept = [label for label in recording.markers.labels if label not in labels]
    return replace(recording, markers=recording.markers.select(kept))


def noted(notes, start: str) -> str:
    (note,) = [note for note in notes if note.startswith(start)]
    return note


def test_what_no_marker_shows_is_locked_at_its_default_and_said(prepared, gait2354):
    assert prepared.skeleton.locked == {"mtp_angle_r": 0.0, "mtp_angle_l": 0.0}
    assert "mtp_angle_r (0 deg), mtp_angle_l (0 deg)" in noted(prepared.notes, "no marker shows")


def test_a_default_other_than_zero_is_kept(gait2354, walk):
    joints = tuple(
        replace(joint, coordinates=tuple(replace(c, default=0.1) for c in joint.coordinates))
        for joint in gait2354.joints
    )
    ready = prepare_osim(SUBJECT, replace(gait2354, joints=joints), [TrialInput(walk)], Settings(), False)
    assert ready.skeleton.locked == {"mtp_angle_r": 0.1, "mtp_angle_l": 0.1}


def test_markers_of_either_side_only_are_listed(prepared):
    left_out = noted(prepared.notes, "subject01_walk1: markers that the model does not have")
    assert "R.Bicep" in left_out
    absent = noted(prepared.notes, "subject01_walk1: markers of the model that it does not have")
    assert "R.Knee.Med" in absent


def test_the_trial_is_not_turned_and_markers_stay(prepared, gait2354, walk):
    (kinematics,) = prepared.kinematics
    assert kinematics.turned_deg == 0.0
    np.testing.assert_array_equal(kinematics.trial.markers.positions, walk.markers.positions)
    np.testing.assert_array_equal(prepared.skeleton.marker_locals, gait2354.skeleton.marker_locals)
    assert prepared.uncertainty.marker_sd_m is None
    assert not prepared.uncertainty.centres


def test_loads_act_on_the_heaviest_body_of_each_foot(prepared):
    assert prepared.skeleton.feet == ("calcn_r", "calcn_l")


def test_light_bodies_are_held_and_all_are_kept(prepared, gait2354):
    assert prepared.uncertainty.held.segments == ("talus_r", "toes_r", "talus_l", "toes_l")
    assert set(prepared.prior.mean.segments) | set(prepared.uncertainty.held.segments) == set(gait2354.bsp.segments)
    assert "talus_r (tibia_r), toes_r (calcn_r)" in noted(prepared.notes, "bodies that weigh less than 0.5 kg")
    assert prepared.prior.mass_kg + prepared.uncertainty.held_kg == pytest.approx(72.6)


def test_of_bodies_that_move_as_one_the_heaviest_is_estimated(rajagopal):
    """Subtalar and toe joints are locked in this model, wrists too; a hand weighs 0.52 kg."""
    prior, held = parted(rajagopal.skeleton, rajagopal.bsp)
    assert {"talus_r", "toes_r", "hand_r", "patella_r"} <= set(held.segments)
    assert {"calcn_r", "radius_r", "ulna_r", "femur_r"} <= set(prior.mean.segments)


def test_prior_deviations_go_by_the_names_of_bodies(rajagopal):
    prior, _ = parted(rajagopal.skeleton, rajagopal.bsp)
    share = dict(zip(prior.mean.segments, prior.sd[:, 0] / prior.mean.mass_kg, strict=True))
    for body, kind in (("femur_l", "thigh"), ("calcn_r", "foot"), ("ulna_r", "forearm"), ("torso", "torso")):
        assert kind_of(body) == kind
        assert share[body] == pytest.approx(MASS_SD[kind])
    renamed = tuple(name.replace("torso", "backpack") for name in rajagopal.bsp.segments)
    strange = replace(rajagopal.bsp, segments=renamed)
    skeleton = replace(
        rajagopal.skeleton,
        joints=tuple(
            replace(j, parent=j.parent.replace("torso", "backpack"), child=j.child.replace("torso", "backpack"))
            for j in rajagopal.skeleton.joints
        ),
        markers=(),
    )
    prior, _ = parted(skeleton, strange)
    row = prior.mean.segments.index("backpack")
    assert prior.sd[row, 0] / prior.mean.mass_kg[row] == pytest.approx(OTHER_MASS_SD)


def test_masses_are_those_of_the_person(gait2354, walk):
    scaled, factor = at_mass(gait2354.bsp, 80.0)
    assert factor == pytest.approx(80.0 / 72.6)
    assert scaled.total_mass_kg == pytest.approx(80.0)
    np.testing.assert_allclose(scaled.inertia_kgm2, gait2354.bsp.inertia_kgm2 * factor)
    np.testing.assert_array_equal(scaled.com_m, gait2354.bsp.com_m)
    ready = prepare_osim(SUBJECT.model_copy(update={"mass_kg": 75.0}), gait2354, [TrialInput(walk)], Settings(), False)
    assert "multiplied by 1.033" in noted(ready.notes, "the model weighs 72.6 kg, the person 75.0 kg")
    assert ready.literature.total_mass_kg == pytest.approx(75.0)


def test_calibration_moves_markers_and_frees_joint_centres(gait2354, walk):
    ready = prepare_osim(SUBJECT, gait2354, [TrialInput(walk)], Settings(), True)
    assert set(ready.uncertainty.centres) == {f"{j}/offset_{a}" for j in ("hip_r", "hip_l", "back") for a in "xyz"}
    assert ready.kinematics[0].ik.marker_rms_m < 0.010
    assert ready.uncertainty.marker_sd_m > 0


def test_offsets_move_a_joint_along_its_parents_axes(rajagopal):
    """The frames of this model's shoulders and hips are turned in their parents."""
    skeleton = with_centre_offsets(rajagopal, rajagopal.skeleton)
    shift = np.array([0.01, -0.02, 0.03])
    moved = skeleton.lock({f"acromial_r/offset_{axis}": v for axis, v in zip("xyz", shift, strict=True)})
    q = np.random.default_rng(0).uniform(-0.5, 0.5, (3, len(skeleton.coordinates)))
    before, after = skeleton.pose(q), moved.pose(q)
    torso, arm = (skeleton.segments.index(name) for name in ("torso", "humerus_r"))
    np.testing.assert_allclose(
        after.translation[:, arm] - before.translation[:, arm], before.rotation[:, torso] @ shift
    )
    np.testing.assert_allclose(after.translation[:, torso], before.translation[:, torso])
    np.testing.assert_allclose(centre_offsets(moved)["acromial_r"], shift)
    np.testing.assert_array_equal(centre_offsets(moved)["hip_l"], 0.0)


def test_arms_do_not_turn_over(measured_folder):
    """With the arm turned by half a turn and the elbow bent backwards, its markers fit nearly as well."""
    folder = measured_folder / "subject4"
    skeleton = read_osim(folder / "addbiomechanics_scaled.osim").skeleton
    ik = solve_ik(skeleton.lock({"mtp_angle_r": 0.0, "mtp_angle_l": 0.0}), read_trc(folder / "squats1.trc"))
    elbows = ik.q[:, [ik.coordinates.index(f"elbow_flex_{side}") for side in "rl"]]
    assert elbows.min() > 0.0
    assert elbows.max() < 2.7
    assert np.abs(np.diff(ik.q, axis=0)).max() < 0.2
    assert ik.marker_rms_m < 0.011


def test_a_model_without_markers(measured_folder, walk):
    bare = read_osim(measured_folder / "gait2354" / "gait2354_simbody.osim")
    with pytest.raises(OsimError, match="no markers in it; scale the model") as error:
        prepare_osim(SUBJECT, bare, [TrialInput(walk)], Settings(), False)
    assert "gait2354_simbody.osim" in str(error.value)


def test_a_model_without_feet(gait2354, walk):
    joints = tuple(j for j in gait2354.skeleton.joints if not j.child.startswith(("talus", "calcn", "toes")))
    markers = tuple(m for m in gait2354.skeleton.markers if not m.segment.startswith("calcn"))
    footless = replace(gait2354, skeleton=replace(gait2354.skeleton, joints=joints, markers=markers))
    with pytest.raises(OsimError, match="no body of the right foot; expected one named calcn_r"):
        prepare_osim(SUBJECT, footless, [TrialInput(walk)], Settings(), False)


def test_a_trial_without_markers_of_a_foot(gait2354, walk):
    left = [m.label for m in gait2354.skeleton.markers if m.segment == "calcn_l"]
    with pytest.raises(TrialError, match="no marker of the left foot is in the file"):
        prepare_osim(SUBJECT, gait2354, [TrialInput(without(walk, left))], Settings(), False)


def test_mass_is_needed_and_nothing_else(gait2354, walk):
    with pytest.raises(SubjectError, match="--mass"):
        prepare_osim(Subject(name="A"), gait2354, [TrialInput(walk)], Settings(), False)


def test_somebody_old_is_warned_of_with_a_model_too(gait2354, walk):
    old = SUBJECT.model_copy(update={"age_years": 72.0})
    warnings = prepare_osim(old, gait2354, [TrialInput(walk)], Settings(), False).warnings
    assert any(one.startswith("population: elderly (72 years)") for one in warnings)


@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_mass_without_inertia_is_refused(gait2354, walk, factor):
    """It ended in a matrix that is not positive definite."""
    bsp = gait2354.bsp
    inertia = np.where((np.array(bsp.segments) == "femur_r")[:, None, None], factor, 1.0) * bsp.inertia_kgm2
    bad = replace(gait2354, bsp=replace(bsp, inertia_kgm2=inertia))
    with pytest.raises(OsimError, match=r"inertia of zero or less for bodies that have mass: femur_r \([0-9.]+ kg\)"):
        prepare_osim(SUBJECT, bad, [TrialInput(walk)], Settings(), False)


def test_inertias_too_small_for_the_mass_are_said(gait2354, walk, prepared):
    assert not any("denser" in warning for warning in prepared.warnings)
    small = replace(gait2354, bsp=replace(gait2354.bsp, inertia_kgm2=0.1 * gait2354.bsp.inertia_kgm2))
    warnings = prepare_osim(SUBJECT, small, [TrialInput(walk)], Settings(), False).warnings
    assert any("subject01_scaled.osim: moments of inertia too small for the mass" in one for one in warnings)


def test_joints_that_do_not_mirror_each_other_are_said(gait2354, walk, prepared):
    assert not any("mirror" in warning for warning in prepared.warnings)
    joints = tuple(
        replace(j, translation=j.translation + np.array([0.03, 0.0, 0.0])) if j.child == "talus_r" else j
        for j in gait2354.skeleton.joints
    )
    moved = replace(gait2354, skeleton=replace(gait2354.skeleton, joints=joints))
    warnings = prepare_osim(SUBJECT, moved, [TrialInput(walk)], Settings(), False).warnings
    (warning,) = [one for one in warnings if "mirror" in one]
    assert warning.startswith("subject01_scaled.osim: left and right do not mirror each other in the places")
    assert "talus_r and talus_l (30 mm)" in warning


def test_markers_in_millimetres_are_refused(gait2354, walk):
    skeleton = gait2354.skeleton.with_places(1000.0 * gait2354.skeleton.marker_locals)
    with pytest.raises(OsimError, match=r"subject01_scaled\.osim: the distance of marker 'Top\.Head' .* is 702 m; exp"):
        prepare_osim(SUBJECT, replace(gait2354, skeleton=skeleton), [TrialInput(walk)], Settings(), False)
