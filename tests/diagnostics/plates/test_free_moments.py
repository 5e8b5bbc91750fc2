"""Mean vertical moments over whole strides: synthetic gait where they are known, and whole trials."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gait_loads import MASS_KG, gait_loads
from kinertia.diagnostics.plates.free_moments import VERTICAL_MOMENT_LEVER_M, mean_vertical_moment, vertical_moment
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.io.opensim.reader import read_osim
from kinertia.model.imported_model import markers_of_model
from kinertia.model.marker_set import MarkerSet
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import FootLoads, PlateLoads, Recording
from plate_findings import context_of
from recordings import here

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


def moment_of(loads, body, start_s=0.9, end_s=2.2):
    inside = (loads.time >= start_s) & (loads.time <= end_s)
    return mean_vertical_moment(loads, loads.time[inside], body[inside])


def test_mirror_image_free_moments_are_fine():
    loads, body, free = gait((6.0, -6.0))
    moment = moment_of(loads, body)
    assert moment.free_nm == pytest.approx(free, abs=0.02)
    assert free[0] > 2.5
    assert moment.moment_nm == pytest.approx(0.0, abs=0.05)
    assert not moment.contradicts
    assert moment.allowed_nm == pytest.approx(VERTICAL_MOMENT_LEVER_M * MASS_KG * 9.81, rel=0.01)


@pytest.mark.parametrize("free_nm", [(3.0, 8.0), (-8.0, -3.0)])
def test_free_moments_to_the_same_side(free_nm):
    loads, body, free = gait(free_nm)
    moment = moment_of(loads, body)
    assert moment.moment_nm == pytest.approx(free.sum(), abs=0.05)
    assert moment.contradicts
    assert moment.by_free_moments


def test_one_plate_with_the_wrong_sign():
    right, left = 6.0, -6.0
    assert moment_of(*gait((right, -left))[:2]).contradicts
    assert not moment_of(*gait((right, left))[:2]).contradicts


def test_opposite_free_moments_that_do_not_cancel():
    moment = moment_of(*gait((1.0, -9.0))[:2])
    assert moment.contradicts
    assert moment.by_free_moments


def test_turned_plates_are_not_blamed_on_free_moments():
    """Braking ahead of the body and pushing behind it turn it once the plates' axes are turned."""
    moment = moment_of(*gait(plates_turned_deg=15.0)[:2])
    assert moment.contradicts
    assert moment.free_nm == pytest.approx((0.0, 0.0), abs=1e-9)
    assert not moment.by_free_moments


def test_neither_axes_nor_floor_nor_the_place_of_the_body_matter():
    loads, body, _ = gait((3.0, 8.0))
    turn = Rotation.from_euler("y", 70, degrees=True).as_matrix()
    lower = replace(loads, moment=loads.moment - np.cross([0.0, 0.3, 0.0], loads.force))
    plain, turned, sunk, beside = (
        moment_of(*case)
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
    strides = (loads.time >= plain.span_s[0]) & (loads.time <= plain.span_s[1])
    forward, _, right = loads.force[strides].sum(axis=1).mean(axis=0)  # next to nothing: whole strides
    assert beside.moment_nm - plain.moment_nm == pytest.approx(0.1 * right - 0.03 * forward, abs=1e-3)


def test_silent_without_whole_strides_or_a_foot():
    loads, body, _ = gait((3.0, 8.0))
    assert moment_of(loads, body, 0.9, 1.7) is None
    unloaded = replace(loads, force=loads.force * [[[1], [0]]], moment=loads.moment * [[[1], [0]]])
    assert moment_of(unloaded, body) is None


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


def found(recording, marker_set=None):
    """P266; with no marker set, a preset."""
    return [*vertical_moment(context_of(recording, marker_set))]


def test_a_recording(walked):
    assert found(walked) == []
    (wrong,) = found(crosstalk(walked, (0.0, 5.0)))
    assert wrong.code == "P266"
    right, left = (wrong.evidence[f"free_{side}_nm"].value for side in ("right", "left"))
    assert wrong.evidence["moment_nm"].value > wrong.evidence["moment_nm"].limit
    assert 0.0 < right < left
    assert "Mz" in wrong.causes[0]
    positions = walked.markers.positions.copy()
    positions[100:104, walked.markers.labels.index("R.ASIS")] = np.nan
    gap = replace(walked, markers=replace(walked.markers, positions=positions))
    assert found(gap) == []
    assert len(found(crosstalk(gap, (0.0, 5.0)))) == 1
    assert found(replace(walked, plates=None)) == []


def test_it_goes_by_the_pelvis_markers_that_there_are(walked):
    wrong, marker_set = crosstalk(walked, (0.0, 5.0)), choose_marker_set(walked.markers.labels)
    named = {**marker_set.segments, "pelvis": (*marker_set.segments["pelvis"], "Not.Worn")}
    assert found(wrong, replace(marker_set, segments=named)) == found(wrong)
    none = {name: labels for name, labels in marker_set.segments.items() if name != "pelvis"}
    assert found(wrong, MarkerSet("a model", {}, none, {})) == []


TRIALS = {
    "synthetic/long.trc": ("synthetic/long_grf.mot", False),
    "synthetic/run.trc": ("synthetic/run_grf.mot", False),
    "synthetic/walk.trc": ("synthetic/walk_grf.mot", False),
    "synthetic/walk.c3d": (None, False),
    "synthetic/squats.trc": ("synthetic/squats_grf.mot", False),
    "gait2354/subject01_walk1.trc": ("gait2354/subject01_walk1_grf.mot", True),
    "rajagopal_walk/motion_capture_walk.trc": ("rajagopal_walk/grf_walk.mot", False),
    "pig_c3d/subject_a_walk.c3d": (None, False),
    "pig_c3d/subject_b_walk.c3d": (None, False),
    "subject4/walking1.trc": ("subject4/walking1_grf.mot", False),
    "subject4/walking2.trc": ("subject4/walking2_grf.mot", False),
    "subject4/squats1.trc": ("subject4/squats1_grf.mot", False),
}


@pytest.mark.parametrize("name", here(TRIALS))
def test_whole_trials(file_of, recording_of, name):
    """Many do not hold a whole stride."""
    forces, contradicts = TRIALS[name]
    recording = recording_of(name, forces)
    body = None
    if "subject4" in name:
        body = markers_of_model(read_osim(file_of("subject4/addbiomechanics_scaled.osim")))
    assert bool(found(recording, body)) == contradicts
