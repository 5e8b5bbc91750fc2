from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import BlockedError, OsimError, SubjectError
from kinertia.estimation.prior import MASS_SD, OTHER_MASS_SD
from kinertia.findings.finding import Severity
from kinertia.io.opensim.reader import read_osim
from kinertia.io.opensim.writer import export_osim
from kinertia.io.text.trc import read_trc
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel, centre_offsets
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.settings import Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.opensim_model import at_mass, kind_of, partition, with_centre_offsets
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare
from recordings import here
from refusals import expect_evidence, expect_filled, refused
from users_model import WITHOUT

SUBJECT = Subject(name="A", mass_kg=72.6)


MODELS = here(["synthetic/users.osim", "rajagopal_walk/scaled.osim"])


@pytest.fixture(scope="module")
def model(file_of) -> OsimModel:
    return read_osim(file_of("synthetic/users.osim"))


@pytest.fixture(scope="module", params=MODELS)
def other_model(request, file_of) -> OsimModel:
    return read_osim(file_of(request.param))


@pytest.fixture(scope="module")
def walk(recording_of):
    return recording_of(*(f"synthetic/walk{end}" for end in (".trc", "_grf.mot", "_grf.xml")))


@pytest.fixture(scope="module")
def prepared(model, walk):
    return prepare(Person(SUBJECT, [TrialInput(walk)], model=model))


def without(recording, labels):
    kept = [label for label in recording.markers.labels if label not in labels]
    return replace(recording, markers=recording.markers.select(kept))


def of_code(ready, code):
    return [finding for finding in ready.findings if finding.code == code]


@contextmanager
def blocked(code):
    """Preparing stops with one finding, of this code; yields it once it has."""
    caught = []
    with pytest.raises(BlockedError) as stopped:
        yield caught
    (found,) = stopped.value.blocking
    assert (found.code, found.severity) == (code, Severity.ERROR)
    expect_filled(found)
    caught.append(found)


def test_what_no_marker_shows_is_locked_at_its_default_and_said(prepared, model):
    assert prepared.skeleton.locked == {"mtp_angle_r": 0.0, "mtp_angle_l": 0.0}
    found = of_code(prepared, "O412")
    assert [(finding.where.part, finding.evidence["value"].value) for finding in found] == [
        ("mtp_angle_r", 0),
        ("mtp_angle_l", 0),
    ]
    for reported in found:
        expect_filled(reported)


def test_a_default_other_than_zero_is_kept(model, walk):
    joints = tuple(
        replace(joint, coordinates=tuple(replace(c, default=0.1) for c in joint.coordinates)) for joint in model.joints
    )
    ready = prepare(Person(SUBJECT, [TrialInput(walk)], model=replace(model, joints=joints)))
    assert ready.skeleton.locked == {"mtp_angle_r": 0.1, "mtp_angle_l": 0.1}


def test_markers_of_either_side_only_are_listed(prepared):
    (left_out,), (absent,) = (of_code(prepared, code) for code in ("O414", "M105"))
    assert left_out.where.trial == absent.where.trial == "walk"
    assert WITHOUT in left_out.where.markers
    assert "R.Knee.Med" in absent.where.markers


def test_the_trial_is_not_turned_and_markers_stay(prepared, model, walk):
    (kinematics,) = prepared.kinematics
    assert kinematics.turned_deg == 0.0
    np.testing.assert_array_equal(kinematics.trial.markers.positions, walk.markers.positions)
    np.testing.assert_array_equal(prepared.skeleton.marker_locals, model.skeleton.marker_locals)
    assert prepared.uncertainty.marker_sd_m is None
    assert not prepared.uncertainty.centres


def test_loads_act_on_the_heaviest_body_of_each_foot(prepared):
    assert prepared.skeleton.feet == ("calcn_r", "calcn_l")


def test_light_bodies_are_held_and_all_are_kept(prepared, model):
    light = [f"{kind}_{side}" for side in "rl" for kind in ("patella", "talus", "toes")]
    assert prepared.uncertainty.fixed.segments == (*light, "hand_r", "hand_l")
    assert set(prepared.prior.mean.segments) | set(prepared.uncertainty.fixed.segments) == set(model.bsp.segments)
    found = of_code(prepared, "O413")
    assert tuple(finding.where.part for finding in found) == prepared.uncertainty.fixed.segments
    masses = [finding.evidence["mass_kg"].value for finding in found]
    assert masses == pytest.approx(prepared.uncertainty.fixed.mass_kg)
    assert max(masses) < 0.5
    for reported in found:
        expect_filled(reported)
    assert prepared.prior.mass_kg + prepared.uncertainty.fixed_kg == pytest.approx(72.6)


def test_of_bodies_that_move_as_one_the_heaviest_is_estimated(other_model):
    """Subtalar and toe joints are locked in this model, wrists too; a hand weighs 0.52 kg."""
    prior, held = partition(other_model.skeleton, other_model.bsp)
    assert {"talus_r", "toes_r", "hand_r", "patella_r"} <= set(held.segments)
    assert {"calcn_r", "radius_r", "ulna_r", "femur_r"} <= set(prior.mean.segments)


def test_prior_deviations_go_by_the_names_of_bodies(other_model):
    prior, _ = partition(other_model.skeleton, other_model.bsp)
    share = dict(zip(prior.mean.segments, prior.sd[:, 0] / prior.mean.mass_kg, strict=True))
    for body, kind in (("femur_l", "thigh"), ("calcn_r", "foot"), ("ulna_r", "forearm"), ("torso", "torso")):
        assert kind_of(body) == kind
        assert share[body] == pytest.approx(MASS_SD[kind])
    renamed = tuple(name.replace("torso", "backpack") for name in other_model.bsp.segments)
    strange = replace(other_model.bsp, segments=renamed)
    skeleton = replace(
        other_model.skeleton,
        joints=tuple(
            replace(j, parent=j.parent.replace("torso", "backpack"), child=j.child.replace("torso", "backpack"))
            for j in other_model.skeleton.joints
        ),
        markers=(),
    )
    prior, _ = partition(skeleton, strange)
    row = prior.mean.segments.index("backpack")
    assert prior.sd[row, 0] / prior.mean.mass_kg[row] == pytest.approx(OTHER_MASS_SD)


def test_masses_are_those_of_the_person(model, walk):
    scaled, factor = at_mass(model.bsp, 80.0)
    assert factor == pytest.approx(80.0 / 72.6)
    assert scaled.total_mass_kg == pytest.approx(80.0)
    np.testing.assert_allclose(scaled.inertia_kgm2, model.bsp.inertia_kgm2 * factor)
    np.testing.assert_array_equal(scaled.com_m, model.bsp.com_m)
    ready = prepare(Person(SUBJECT.model_copy(update={"mass_kg": 75.0}), [TrialInput(walk)], model=model))
    (found,) = of_code(ready, "O411")
    expect_evidence(found, factor=75.0 / 72.6, model_kg=72.6, stated_kg=75.0)
    assert ready.literature.total_mass_kg == pytest.approx(75.0)


def test_calibration_moves_markers_and_frees_joint_centres(model, walk):
    ready = prepare(Person(SUBJECT, [TrialInput(walk)], model=model, calibrate=True))
    joints = [f"to_{body}" for body in ("femur_r", "femur_l", "torso", "humerus_r", "humerus_l")]
    assert set(ready.uncertainty.centres) == {f"{j}/offset_{a}" for j in joints for a in "xyz"}
    assert ready.kinematics[0].ik.marker_rms_m < 0.010
    assert ready.uncertainty.marker_sd_m > 0


def test_offsets_move_a_joint_along_its_parents_axes(other_model):
    """The frames of the synthetic model's shoulders and hips are turned in their parents."""
    names = dict(zip(other_model.skeleton.segments, (joint.name for joint in other_model.joints), strict=True))
    shoulder, hip = names["humerus_r"], names["femur_l"]
    skeleton = with_centre_offsets(other_model, other_model.skeleton)
    frame = skeleton.joints[skeleton.segments.index("humerus_r")].rotation
    assert np.allclose(frame, np.eye(3)) == (other_model.path.name != "users.osim")
    shift = np.array([0.01, -0.02, 0.03])
    moved = skeleton.lock({f"{shoulder}/offset_{axis}": v for axis, v in zip("xyz", shift, strict=True)})
    q = np.random.default_rng(0).uniform(-0.5, 0.5, (3, len(skeleton.coordinates)))
    before, after = skeleton.pose(q), moved.pose(q)
    torso, arm = (skeleton.segments.index(name) for name in ("torso", "humerus_r"))
    np.testing.assert_allclose(
        after.translation[:, arm] - before.translation[:, arm], before.rotation[:, torso] @ shift
    )
    np.testing.assert_allclose(after.translation[:, torso], before.translation[:, torso])
    np.testing.assert_allclose(centre_offsets(moved)[shoulder], shift)
    np.testing.assert_array_equal(centre_offsets(moved)[hip], 0.0)


@pytest.mark.parametrize(
    ("file", "trial"),
    here(
        [
            ("synthetic/users.osim", "synthetic/walk.trc"),
            ("subject4/addbiomechanics_scaled.osim", "subject4/squats1.trc"),
        ]
    ),
)
def test_arms_do_not_turn_over(file_of, file, trial):
    """With the arm turned by half a turn and the elbow bent backwards, its markers fit nearly as well."""
    skeleton = read_osim(file_of(file)).skeleton
    ik = solve_ik(skeleton.lock({"mtp_angle_r": 0.0, "mtp_angle_l": 0.0}), read_trc(file_of(trial)))
    elbows = ik.q[:, [ik.coordinates.index(f"elbow_flex_{side}") for side in "rl"]]
    assert elbows.min() > 0.0
    assert elbows.max() < 2.7
    assert np.abs(np.diff(ik.q, axis=0)).max() < 0.2
    assert ik.marker_rms_m < 0.011


def test_a_model_without_markers(model, walk, tmp_path):
    export_osim(tmp_path / "bare.osim", replace(model.skeleton, markers=()), model.bsp)
    with refused("O106", error=OsimError) as caught:
        prepare(Person(SUBJECT, [TrialInput(walk)], model=read_osim(tmp_path / "bare.osim")))
    assert caught.value.finding.where.file == "bare.osim"


def test_a_model_without_feet(model, walk):
    feet = ("talus", "calcn", "toes")
    joints = tuple(j for j in model.skeleton.joints if not j.child.startswith(feet))
    markers = tuple(m for m in model.skeleton.markers if not m.segment.startswith(feet))
    rows = [k for k, name in enumerate(model.bsp.segments) if not name.startswith(feet)]
    names = tuple(model.bsp.segments[k] for k in rows)
    bsp = BodySegmentParameters.from_table(names, model.bsp.table()[rows])
    footless = replace(model, skeleton=replace(model.skeleton, joints=joints, markers=markers), bsp=bsp)
    with pytest.raises(BlockedError) as stopped:
        prepare(Person(SUBJECT, [TrialInput(walk)], model=footless))
    found = stopped.value.blocking
    assert [(finding.code, finding.where.part) for finding in found] == [("O107", "right foot"), ("O107", "left foot")]
    expect_evidence(found[0], expected="calcn_r")
    assert found[0].where.file == "users.osim"


def test_a_trial_without_markers_of_a_foot(model, walk):
    left = [m.label for m in model.skeleton.markers if m.segment == "calcn_l"]
    with blocked("M104") as found:
        prepare(Person(SUBJECT, [TrialInput(without(walk, left))], model=model))
    assert (found[0].where.trial, found[0].where.part) == ("walk", "left foot")


def test_mass_is_needed_and_nothing_else(model, walk):
    with pytest.raises(SubjectError) as caught:
        prepare(Person(Subject(name="A"), [TrialInput(walk)], model=model))
    assert (caught.value.field, caught.value.finding.code) == ("mass_kg", "S101")


def test_somebody_old_is_reported_with_a_model_too(model, walk):
    old = SUBJECT.model_copy(update={"age_years": 72.0})
    (found,) = of_code(prepare(Person(old, [TrialInput(walk)], model=model)), "S401")
    assert (found.severity, found.evidence["population"].value) == (Severity.INFO, "elderly")


@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_mass_without_inertia_is_refused(model, walk, factor):
    """It ended in a matrix that is not positive definite."""
    bsp = model.bsp
    inertia = np.where((np.array(bsp.segments) == "femur_r")[:, None, None], factor, 1.0) * bsp.inertia_kgm2
    bad = replace(model, bsp=replace(bsp, inertia_kgm2=inertia))
    with blocked("O202") as found:
        prepare(Person(SUBJECT, [TrialInput(walk)], model=bad))
    assert found[0].where.part == "femur_r"
    expect_evidence(found[0], mass_kg=bsp.mass_kg[bsp.segments.index("femur_r")])


def test_inertias_too_small_for_the_mass_are_said(model, walk, prepared):
    assert not of_code(prepared, "O203")
    small = replace(model, bsp=replace(model.bsp, inertia_kgm2=0.1 * model.bsp.inertia_kgm2))
    found = of_code(prepare(Person(SUBJECT, [TrialInput(walk)], model=small)), "O203")
    assert "femur_r" in [finding.where.part for finding in found]
    for finding in found:
        assert finding.severity is Severity.WARNING
        assert finding.evidence["density_kg_m3"].value > finding.evidence["density_kg_m3"].limit


def test_joints_that_do_not_mirror_each_other_are_said(model, walk, prepared):
    assert not [finding for finding in prepared.findings if finding.code.startswith("O30")]
    joints = tuple(
        replace(j, translation=j.translation + np.array([0.03, 0.0, 0.0])) if j.child == "talus_r" else j
        for j in model.skeleton.joints
    )
    moved = replace(model, skeleton=replace(model.skeleton, joints=joints))
    ready = prepare(Person(SUBJECT, [TrialInput(walk)], model=moved))
    (found,) = [finding for finding in ready.findings if finding.code.startswith("O30")]
    assert (found.code, found.severity) == ("O303", Severity.WARNING)
    assert (found.evidence["right"].value, found.evidence["left"].value) == ("talus_r", "talus_l")
    assert found.evidence["distance_m"].value == pytest.approx(0.03, abs=0.001)


def test_markers_in_millimetres_are_refused(model, walk):
    skeleton = model.skeleton.with_positions(1000.0 * model.skeleton.marker_locals)
    m = 1000.0 * np.linalg.norm(model.skeleton.marker_locals[model.skeleton.labels.index("Top.Head")])
    with blocked("O301") as found:
        prepare(Person(SUBJECT, [TrialInput(walk)], model=replace(model, skeleton=skeleton)))
    expect_evidence(found[0], what="marker Top.Head")
    assert found[0].evidence["length_m"].value == pytest.approx(m, abs=0.5)
