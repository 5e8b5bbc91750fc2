"""Residuals and markers set to what OpenSim's guideline names, and joint angles to what joints do."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.residuals import joint_angles, residuals
from kinertia.model.coordinate_range import Range

FRAMES = 50
LIGHT_KG, HEAVY_KG = 20.0, 80.0
"""By the residual per body mass no residual that is not good is harmless for the light person."""
SEGMENTS = {"RASI": "pelvis", "RANK": "tibia_r", "RWRA": "hand_r"}
MARKERS = [SimpleNamespace(label=label, segment=segment) for label, segment in SEGMENTS.items()]


def found(force_n=0.0, moment_nm=0.0, external_n=800.0, markers_m=0.008, full=1.0, **changes):
    """Code -> finding of a fit whose residual has this length throughout; a pair is RMS-filling base and one frame's
    peak."""
    residual = np.zeros((FRAMES, 6))
    for column, size in ((0, force_n), (4, moment_nm)):
        base, peak = size if isinstance(size, tuple) else (size, size)
        residual[:, column] = base
        residual[7, column] = -peak
    loads = np.zeros((FRAMES, 2, 6))
    loads[:, :, 1] = external_n / 2
    trial = SimpleNamespace(
        name="walk",
        motion_hz=12.0,
        residuals={"estimate": residual},
        full_residuals={"estimate": full * residual},
        kinematics=SimpleNamespace(complete=True, foot_loads=loads, ik=SimpleNamespace(labels=tuple(SEGMENTS))),
        marker_errors_m={"final": np.tile(np.broadcast_to(markers_m, 3), (FRAMES, 1))},
        skeleton=SimpleNamespace(markers=MARKERS),
    )
    known = {"trials": (trial,), "file": None, "skeleton": SimpleNamespace(locked={}), "mass_kg": LIGHT_KG}
    fit = SimpleNamespace(**{**known, **changes})
    answers = list(residuals(ResultContext(fit, None)))
    assert {finding.where.trial for finding in answers} <= {"walk"}
    return {finding.code: finding for finding in answers}


def levels(answers):
    return {code: finding.severity.name for code, finding in answers.items()}


def test_a_good_fit_has_no_finding():
    assert found(4.0, 20.0) == {}


@pytest.mark.parametrize(
    ("force", "expected"),
    [(5.0, None), (5.1, "WARNING"), (10.0, "WARNING"), (10.1, "ERROR"), ((3.0, 9.9), None), ((3.0, 10.1), "WARNING"),
     ((3.0, 25.0), "WARNING"), ((3.0, 25.1), "ERROR")],
)  # fmt: skip
def test_force_by_the_guideline(force, expected):
    assert levels(found(force)).get("R301") == expected


@pytest.mark.parametrize(
    ("force", "expected"),
    [(5.1, "INFO"), (8.7, "INFO"), (8.9, "WARNING"), (10.1, "ERROR"), ((3.0, 24.9), "INFO"), ((3.0, 25.1), "ERROR"),
     (4.9, None)],
)  # fmt: skip
def test_a_force_is_judged_by_what_it_does_to_the_moments_of_this_body(force, expected):
    """0.11 N per kg are 8.8 N for 80 kg; beyond OpenSim's guideline nothing is harmless."""
    assert levels(found(force, mass_kg=HEAVY_KG)).get("R301") == expected


@pytest.mark.parametrize(
    ("moment", "expected"),
    [(30.0, None), (30.1, "WARNING"), (50.0, "WARNING"), (50.1, "ERROR"), ((9.0, 50.1), "WARNING"),
     ((9.0, 75.1), "ERROR")],
)  # fmt: skip
def test_moment_by_the_guideline(moment, expected):
    assert levels(found(0.0, moment)).get("R302") == expected


def test_residuals_are_judged_at_the_motions_bandwidth_and_those_at_full_bandwidth_are_information():
    """Three times as much at full bandwidth bars nothing, and is not kept silent."""
    answers = found(4.0, 20.0, full=3.0)
    assert levels(answers) == {"R301": "INFO", "R302": "INFO"}
    force, moment = (answers[code].evidence for code in ("R301", "R302"))
    assert [force[name].value for name in ("rms_n", "peak_n", "full_rms_n", "full_peak_n")] == [4.0, 4.0, 12.0, 12.0]
    assert [moment[name].value for name in ("rms_nm", "full_peak_nm")] == [20.0, 60.0]
    assert force["motion_hz"].value == 12.0
    assert levels(found((3.0, 9.0), full=1.2)) == {"R301": "INFO"}  # its peak alone


def test_five_percent_of_the_external_force():
    """A child of 20 kg: 12 N are within OpenSim's newtons, and too much for 200 N."""
    answers = found((3.0, 12.0), external_n=200.0)
    assert levels(answers) == {"R301": "WARNING", "R303": "ERROR"}
    assert answers["R303"].evidence["share"].value == pytest.approx(0.06)


@pytest.mark.parametrize(("markers_m", "expected"), [(0.012, None), (0.013, "WARNING"), (0.021, "ERROR")])
def test_markers_by_the_guideline(markers_m, expected):
    assert levels(found(markers_m=markers_m)).get("R304") == expected
    of_model = found(markers_m=markers_m, file=object())
    assert levels(of_model).get("R304") == expected
    assert expected is None or "--calibrate" in of_model["R304"].remedy


def test_arms_that_the_model_cannot_follow_bar_nothing():
    """Raised arms, 80 mm off, beside legs that fit: 46 mm RMS."""
    finding = found(markers_m=[0.008, 0.008, 0.08])["R304"]
    assert finding.severity.name == "WARNING"
    assert finding.evidence["legs_m"].value == pytest.approx(0.008)
    assert finding.where.markers[0] == "RWRA"
    assert "arms" in finding.effect
    assert found(markers_m=[0.03, 0.03, 0.008])["R304"].severity.name == "ERROR"


def test_nobody_is_advised_to_let_move_what_moves_already_or_is_grossly_wrong():
    """What moves hides a model that is another person's."""
    moved = {f"hip_r/offset_{axis}": 0.01 for axis in "xyz"}
    for given in ({"markers_m": 0.05}, {"markers_m": 0.03, "skeleton": SimpleNamespace(locked=moved)}):
        assert "--calibrate" not in found(file=object(), **given)["R304"].remedy


def angles(coordinate, degrees, limits_deg=(0.0, 140.0), sd_deg=0.5, stated=False):
    low, high = np.radians(limits_deg)
    ranges = {coordinate: Range(low, high, clamped=False, stated=stated)}
    trial = SimpleNamespace(
        name="walk",
        skeleton=SimpleNamespace(ranges=ranges),
        kinematics=SimpleNamespace(ik=SimpleNamespace(coordinates=("pelvis_tilt", coordinate))),
        motion=SimpleNamespace(q=np.radians([[200.0, 10.0], [0.0, degrees]])),
        deviations=SimpleNamespace(coordinates=np.full((2, 2), np.radians(sd_deg))),
    )
    return list(joint_angles(ResultContext(SimpleNamespace(trials=(trial,)), None)))


@pytest.mark.parametrize(
    ("coordinate", "degrees", "limits_deg", "severity"),
    [("subtalar_angle_r", -40.0, (-35.0, 35.0), "WARNING"), ("subtalar_angle_r", -41.0, (-35.0, 35.0), "ERROR"),
     ("elbow_flex_l", -20.0, (0.0, 150.0), "ERROR"), ("knee_angle_r", -18.0, (0.0, 140.0), "WARNING"),
     ("knee_angle_l", 18.0, (-160.0, 10.0), "WARNING"), ("knee_flex_r", -21.0, (-10.0, 160.0), "ERROR"),
     ("lumbar_rotation", 66.0, (-90.0, 90.0), "ERROR"), ("ankle_angle_r", 80.0, (-90.0, 90.0), "ERROR")],
)  # fmt: skip
def test_angles_that_no_joint_has(coordinate, degrees, limits_deg, severity):
    (finding,) = angles(coordinate, degrees, limits_deg)
    assert (finding.code, finding.severity.name, finding.where.trial, finding.where.part) == (
        "R305",
        severity,
        "walk",
        coordinate,
    )
    assert np.degrees(finding.evidence["angle_rad"].value) == pytest.approx(degrees)
    low, high = finding.evidence["range_rad"].value
    assert not low <= np.radians(degrees) <= high


@pytest.mark.parametrize(
    ("coordinate", "degrees", "limits_deg"),
    [("subtalar_angle_r", -30.0, (-35.0, 35.0)), ("knee_angle_r", -12.0, (0.0, 140.0)),
     ("knee_angle_l", -110.0, (-160.0, 10.0)), ("hip_flexion_r", 130.0, (-30.0, 120.0)), ("toe_r", 90.0, (0.0, 1.0))],
)  # fmt: skip
def test_angles_that_joints_have_and_coordinates_of_unknown_meaning(coordinate, degrees, limits_deg):
    assert angles(coordinate, degrees, limits_deg) == []


def test_an_angle_that_is_beyond_by_less_than_it_is_uncertain():
    """Two SDs; what is impossible is named all the same."""
    assert angles("subtalar_angle_r", -38.0, sd_deg=1.5) == []
    assert len(angles("subtalar_angle_r", -38.0, sd_deg=1.0)) == 1
    assert len(angles("subtalar_angle_r", -41.0, sd_deg=9.0)) == 1


def test_a_range_that_the_user_states_is_the_persons():
    """A knee that bends backwards by 20 degrees, as its owner's does."""
    assert angles("knee_angle_r", -22.0, (-20.0, 150.0), stated=True) == []
    (finding,) = angles("knee_angle_r", -31.0, (-20.0, 150.0), stated=True)
    assert finding.severity.name == "ERROR"
