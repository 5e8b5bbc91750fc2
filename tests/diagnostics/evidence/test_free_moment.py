"""Mean vertical moments over whole strides: synthetic gait where they are known, and whole trials."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gait_loads import MASS_KG, gait_loads
from kinertia.diagnostics.evidence.free_moment import TURNING_LEVER_M, mean_turning
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.io.osim.reader import read_osim
from kinertia.model.marker_set import MarkerSet
from kinertia.model.model_markers import markers_of_model
from kinertia.settings import Subject
from kinertia.synthetic.walk import HEIGHT_M, walk, walking_subject
from kinertia.synthetic.walk import MASS_KG as WALKER_KG
from kinertia.trial.data import FootLoads, PlateLoads, Recording
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate_bsp
from kinertia.workflow.recording import check_recording
from recordings import LONG_WALKS, here

SPEED_M_S, STRIDE_S = 1.2, 1.0


def gait(free_nm=(0.0, 0.0), plates_turned_deg=0.0, duration_s=3.5):
    """Loads of walking along X, the middle of the pelvis over time, and the mean free moments over a stride.

    Feet brake and push, and press to the side; their free moments are these times the share of the weight they bear.
    """
    loads = gait_loads(duration_s, stride_s=STRIDE_S)
    force, time = loads.force.copy(), loads.time
    body = np.stack([SPEED_M_S * time, np.ones_like(time), 0.01 * np.sin(2 * np.pi * time / STRIDE_S)], axis=1)
    point = np.zeros_like(force)
    for foot, (side, start) in enumerate(((1, 0.2), (-1, 0.2 + STRIDE_S / 2))):
        landed = np.floor((time - start) / STRIDE_S) * STRIDE_S + start
        point[:, foot, 0] = SPEED_M_S * (landed + 0.31)
        point[:, foot, 2] = 0.08 * side
        force[:, foot] += 0.15 * force[:, foot, 1:2] * np.sin(2 * np.pi * (time - landed) / 0.62)[:, None] * [-1, 0, 0]
        force[:, foot] += 0.05 * force[:, foot, 1:2] * np.array([0, 0, -side])
    force = force @ Rotation.from_euler("y", plates_turned_deg, degrees=True).as_matrix().T
    share = force[..., 1] / (MASS_KG * 9.81)
    moment = np.cross(point, force)
    moment[..., 1] += np.array(free_nm) * share
    whole = (time >= 1.0) & (time < 1.0 + STRIDE_S)
    return FootLoads(time, force, moment), body, np.array(free_nm) * share[whole].mean(axis=0)


def turning_of(loads, body, start_s=0.9, end_s=2.2):
    inside = (loads.time >= start_s) & (loads.time <= end_s)
    return mean_turning(loads, loads.time[inside], body[inside])


def test_mirror_image_free_moments_are_fine():
    loads, body, free = gait((6.0, -6.0))
    turning = turning_of(loads, body)
    assert turning.free_nm == pytest.approx(free, abs=0.02)
    assert free[0] > 2.5
    assert turning.moment_nm == pytest.approx(0.0, abs=0.05)
    assert not turning.contradicts
    assert "near zero, as it should be" in turning.sentence()
    assert turning.allowed_nm == pytest.approx(TURNING_LEVER_M * MASS_KG * 9.81, rel=0.01)


@pytest.mark.parametrize(("free_nm", "side"), [((3.0, 8.0), "left"), ((-8.0, -3.0), "right")])
def test_free_moments_to_the_same_side_are_told(free_nm, side):
    loads, body, free = gait(free_nm)
    turning = turning_of(loads, body)
    assert turning.moment_nm == pytest.approx(free.sum(), abs=0.05)
    assert turning.contradicts
    assert f"is {abs(turning.moment_nm):.1f} N m to the {side}; it should be near zero" in turning.sentence()
    assert f"have the same sign (right {free[0]:+.1f}, left {free[1]:+.1f} N m" in turning.sentence()


def test_one_plate_with_the_wrong_sign():
    right, left = 6.0, -6.0
    assert turning_of(*gait((right, -left))[:2]).contradicts
    assert not turning_of(*gait((right, left))[:2]).contradicts


def test_opposite_free_moments_that_do_not_cancel():
    turning = turning_of(*gait((1.0, -9.0))[:2])
    assert turning.contradicts
    assert "do not cancel" in turning.sentence()


def test_turned_plates_are_not_blamed_on_free_moments():
    """Braking ahead of the body and pushing behind it turn it once the plates' axes are turned."""
    turning = turning_of(*gait(plates_turned_deg=15.0)[:2])
    assert turning.contradicts
    assert turning.free_nm == pytest.approx((0.0, 0.0), abs=1e-9)
    assert "places and axes of the plates" in turning.sentence()
    assert "free moments" not in turning.sentence()


def test_neither_axes_nor_floor_nor_the_place_of_the_body_matter():
    loads, body, _ = gait((3.0, 8.0))
    turn = Rotation.from_euler("y", 70, degrees=True).as_matrix()
    lower = replace(loads, moment=loads.moment - np.cross([0.0, 0.3, 0.0], loads.force))
    plain, turned, sunk, beside = (
        turning_of(*case)
        for case in (
            (loads, body),
            (loads.rotated(turn), body @ turn.T),
            (lower, body),
            (loads, body + np.array([0.1, 0.5, 0.03])),
        )
    )
    for other in (turned, sunk):
        assert other.moment_nm == pytest.approx(plain.moment_nm, abs=1e-9)
        assert other.free_nm == pytest.approx(plain.free_nm, abs=1e-9)
    strides = (loads.time >= plain.start_s) & (loads.time <= plain.end_s)
    forward, _, right = loads.force[strides].sum(axis=1).mean(axis=0)  # next to nothing: whole strides
    assert beside.moment_nm - plain.moment_nm == pytest.approx(0.1 * right - 0.03 * forward, abs=1e-3)


def test_silent_without_whole_strides_or_a_foot():
    loads, body, _ = gait((3.0, 8.0))
    assert turning_of(loads, body, 0.9, 1.7) is None
    one = replace(loads, force=loads.force * [[[1], [0]]], moment=loads.moment * [[[1], [0]]])
    assert turning_of(one, body) is None


@pytest.fixture(scope="module")
def walked():
    """A synthetic walk that obeys the equations of motion, every step on a plate."""
    made = walk(walking_subject(), 2.7)
    loads = made.foot_loads
    plates = PlateLoads(made.time, ("right", "left"), loads[..., :3], loads[..., 3:], ("r", "l"))
    return Recording("walk", made.markers, plates)


def crosstalk(recording, free_nm):
    """The recording with vertical moments off by this at 700 N, in proportion to the load."""
    plates = recording.plates
    moment = plates.moment.copy()
    moment[..., 1] += np.array(free_nm) * plates.force[..., 1] / 700.0
    return replace(recording, plates=replace(plates, moment=moment))


def verdicts(recording, marker_set=None):
    return [v for v in check_recording(recording, marker_set).verdicts if "over whole strides (" in v.sentence]


def test_check_of_a_recording(walked):
    (fine,) = verdicts(walked)
    assert fine.level == "pass"
    (wrong,) = verdicts(crosstalk(walked, (0.0, 5.0)))
    assert wrong.level == "caution"
    assert "to the left" in wrong.sentence
    positions = walked.markers.positions.copy()
    positions[100:104, walked.markers.labels.index("R.ASIS")] = np.nan
    assert verdicts(replace(walked, markers=replace(walked.markers, positions=positions))) == [fine]
    assert verdicts(replace(walked, plates=None)) == []


def test_the_check_goes_by_the_pelvis_markers_that_there_are(walked):
    (fine,) = verdicts(walked)
    marker_set = choose_marker_set(walked.markers.labels)
    named = {**marker_set.segments, "pelvis": (*marker_set.segments["pelvis"], "Not.Worn")}
    assert verdicts(walked, replace(marker_set, segments=named)) == [fine]
    none = {name: labels for name, labels in marker_set.segments.items() if name != "pelvis"}
    assert verdicts(walked, MarkerSet("a model", {}, none, {})) == []


TRIALS = {
    "synthetic/long.trc": ("synthetic/long_grf.mot", "pass"),
    "synthetic/run.trc": ("synthetic/run_grf.mot", "pass"),
    "synthetic/walk.trc": ("synthetic/walk_grf.mot", None),
    "synthetic/walk.c3d": (None, None),
    "synthetic/squats.trc": ("synthetic/squats_grf.mot", None),
    "gait2354/subject01_walk1.trc": ("gait2354/subject01_walk1_grf.mot", "caution"),
    "rajagopal_walk/motion_capture_walk.trc": ("rajagopal_walk/grf_walk.mot", "pass"),
    "pig_c3d/subject_a_walk.c3d": (None, None),
    "pig_c3d/subject_b_walk.c3d": (None, None),
    "subject4/walking1.trc": ("subject4/walking1_grf.mot", None),
    "subject4/walking2.trc": ("subject4/walking2_grf.mot", None),
    "subject4/squats1.trc": ("subject4/squats1_grf.mot", None),
}


@pytest.mark.parametrize("name", here(TRIALS))
def test_whole_trials(file_of, recording_of, name):
    """Many do not hold a whole stride."""
    forces, level = TRIALS[name]
    recording = recording_of(name, forces)
    own = None
    if "subject4" in name:
        own = markers_of_model(read_osim(file_of("subject4/addbiomechanics_scaled.osim")))
    assert [v.level for v in verdicts(recording, own)] == ([] if level is None else [level])


MEASURED = {"gait2354": "gait2354/subject01_walk1.trc", "rajagopal": "rajagopal_walk/motion_capture_walk.trc"}


def test_a_fit_tells_what_the_check_does(recording_of):
    walk = recording_of(*LONG_WALKS["synthetic"])
    person = Subject(sex="male", mass_kg=WALKER_KG, height_m=HEIGHT_M)

    def told(recording):
        fit = estimate_bsp(person, recording_of("synthetic/static.trc"), [TrialInput(recording, (0.4, 2.0))])
        return [one for one in fit.warnings if "it should be near zero" in one]

    assert told(walk) == []
    (warning,) = told(crosstalk(walk, (0.0, 5.0)))
    assert warning.startswith("long: the mean vertical moment over whole strides")
    assert "the free moments under the feet have the same sign (right +0.2, left +2.4 N m" in warning


@pytest.mark.parametrize(
    ("name", "warned"), [("gait2354", True), pytest.param("rajagopal", False, marks=pytest.mark.slow)]
)
def test_fits_of_measured_walks(request, file_of, name, warned):
    file_of(MEASURED[name])
    fit_of = request.getfixturevalue("fit_of")
    warnings = [w for w in fit_of(name).summary["warnings"] if "it should be near zero" in w]
    assert len(warnings) == int(warned)
    if warned:
        assert warnings[0].startswith("subject01_walk1: the mean vertical moment over whole strides")
        assert "the free moments under the feet have the same sign (right +1.0, left +2.5 N m" in warnings[0]
