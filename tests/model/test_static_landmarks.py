"""Legs that no person has, and thigh wands that are not where they should be."""

from dataclasses import replace

import numpy as np
import pytest

from generic_static import recording, standing_positions
from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.markers.marker_set import landmarks
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_draft import draft_marker_set
from kinertia.io.marker_set_file import read_marker_set
from kinertia.model import joint_centres as jc
from kinertia.model.static_landmarks import ANKLE, KNEE, departures
from refusals import codes, only

CLINIC, PLUG_IN = read_marker_set("cleveland-clinic"), read_marker_set("plug-in-gait-lower-body")
HEIGHT_M = 1.75
WIDTHS_M = {f"{side}{joint}Width": 0.1 for side in "RL" for joint in ("Knee", "Ankle")}
INTO_PLUG_IN = {"ASIS": "ASI", "Knee.Lat": "KNE", "Ankle.Lat": "ANK", "Heel": "HEE", "Toe.Lat": "TOE",
                "Shank.Rear": "TIB"}  # fmt: skip


def rotated_about(positions, centre, other, angle_deg):
    """The other marker rotated about the vertical through the centre, as seen from above, counter-clockwise."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    arm = positions[other] - positions[centre]
    return positions | {other: positions[centre] + [c * arm[0] + s * arm[2], arm[1], -s * arm[0] + c * arm[2]]}


def found(positions, marker_set=CLINIC):
    static = replace(recording(positions), measurements=WIDTHS_M)
    return list(departures(jc.find_landmarks(static, marker_set)))


@pytest.mark.parametrize(("off_deg", "parts"), [(-3.0, []), (3.0, ["knee_r"])])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_knee_axis_beyond_its_limit_is_found(off_deg, parts, sense):
    angle = sense * (np.degrees(KNEE.within) + off_deg)
    departed = found(rotated_about(standing_positions(), "R.Knee.Lat", "R.Knee.Med", angle))
    assert [departure.part for departure in departed] == parts
    assert all(np.degrees(abs(departure.angle_rad)) == pytest.approx(abs(angle), abs=0.1) for departure in departed)


def test_axes_that_differ_between_the_sides_are_found():
    half = np.degrees(KNEE.apart) / 2
    for off_deg, parts in ((-3.0, []), (3.0, ["knee"])):
        positions = standing_positions()
        for side in "RL":
            positions = rotated_about(positions, f"{side}.Knee.Lat", f"{side}.Knee.Med", half + off_deg)
        assert [departure.part for departure in found(positions)] == parts


def test_an_ankle_axis_is_judged_by_the_foot():
    angle = np.degrees(ANKLE.within + ANKLE.centre) + 15.0
    departed = found(rotated_about(standing_positions(), "L.Ankle.Lat", "L.Ankle.Med", -angle))
    assert [(departure.part, departure.limit.name) for departure in departed] == [("ankle_l", "ankle axis")]


def feet_turned(angle_deg):
    """What is found of the right foot once its toes are rotated outwards about the heel."""
    positions = standing_positions()
    for toe in [label for label in positions if label.startswith("R.Toe")]:
        positions = rotated_about(positions, "R.Heel", toe, -angle_deg)
    return [departure for departure in found(positions) if departure.part == "foot_r"]


@pytest.mark.parametrize(("limit_deg", "inside", "beyond"), [(53.0, -1.0, 1.0), (-37.0, 1.0, -1.0)])
def test_feet_may_point_outwards_farther_than_inwards(limit_deg, inside, beyond):
    """45 degrees from 8 outwards, where people's feet point."""
    (across,) = feet_turned(90.0)
    standing_deg = np.degrees(across.angle_rad) - 90.0
    assert feet_turned(limit_deg - standing_deg + inside) == []
    assert len(feet_turned(limit_deg - standing_deg + beyond)) == 1


def plug_in(wand_ahead_m, shank_wand_m=(0.0, 0.12, 0.03)):
    """A person in Plug-in Gait's markers, with wands this far in front of the lateral line of the thigh, and from the
    lateral malleolus forwards, up and outwards.
    """
    positions = standing_positions(HEIGHT_M)
    plug_in_positions = {
        side + name: positions[f"{side}.{ours}"] for ours, name in INTO_PLUG_IN.items() for side in "RL"
    }
    for side, sign in (("R", 1.0), ("L", -1.0)):
        plug_in_positions[f"{side}PSI"] = HEIGHT_M * np.array([-0.065, 0.57, sign * 0.03])
        plug_in_positions[f"{side}THI"] = positions[f"{side}.Knee.Lat"] + [wand_ahead_m, 0.15, sign * 0.03]
        plug_in_positions[f"{side}TIB"] = positions[f"{side}.Ankle.Lat"] + np.multiply(shank_wand_m, [1.0, 1.0, sign])
    static = replace(recording(plug_in_positions), measurements=WIDTHS_M)
    return RecordingContext(static, PLUG_IN, is_static=True, height_m=HEIGHT_M)


def test_a_wand_on_the_front_of_the_thigh_is_not_used():
    context = plug_in(0.08)
    wands = [finding for finding in landmarks(context) if finding.code == "L108"]
    assert [(finding.where.part, finding.severity) for finding in wands] == [
        ("right knee", Severity.WARNING),
        ("left knee", Severity.WARNING),
    ]
    assert all(finding.evidence["direction"].value == "inwards" for finding in wands)
    marks = jc.find_landmarks(context.recording, PLUG_IN)
    pelvis, origin, width, depth = jc.pelvis_frame(marks)
    for side in "rl":
        hip = origin + pelvis @ jc.hip_in_pelvis(width, depth, "bell", side)
        centre, axis = jc.knee(marks, hip, side)
        assert abs(axis[0]) < 0.01
        half = np.linalg.norm(centre - marks[f"knee_lateral_{side}"])
        assert half == pytest.approx(0.05 + jc.MARKER_RADIUS_M)


def test_a_shank_wand_in_front_of_the_shin_is_not_used():
    """It placed an ankle on the outer side of its lateral malleolus: a moment 0.4 N m/kg too large, without a word."""
    context = plug_in(0.0, (0.06, 0.12, -0.05))
    wands = [finding for finding in landmarks(context) if finding.code == "L108"]
    assert [finding.where.part for finding in wands] == ["right ankle", "left ankle"]
    marks = jc.find_landmarks(context.recording, PLUG_IN)
    pelvis, origin, width, depth = jc.pelvis_frame(marks)
    for side, sign in (("r", 1.0), ("l", -1.0)):
        leg = jc.leg_frames(marks, origin + pelvis @ jc.hip_in_pelvis(width, depth, "bell", side), side)
        lateral = marks[f"ankle_lateral_{side}"]
        half = marks.width(f"ankle_{side}") / 2 + jc.MARKER_RADIUS_M
        assert np.linalg.norm(leg.ankle_at - lateral) == pytest.approx(half)
        assert sign * (lateral - leg.ankle_at)[2] > 0.9 * half


def test_a_wand_nearly_in_the_plane_is_used():
    assert "L108" not in codes(list(landmarks(plug_in(0.02))))


def test_a_static_trial_with_an_impossible_knee_is_reported():
    positions = rotated_about(standing_positions(), "R.Knee.Lat", "R.Knee.Med", 50.0)
    context = RecordingContext(recording(positions), CLINIC, is_static=True, height_m=HEIGHT_M)
    finding = only(list(landmarks(context)), "S209", angle_rad=np.radians(50.0), axis="knee axis")
    assert finding.where.part == "right knee"


def test_a_draft_that_cannot_be_right_says_so():
    draft = draft_marker_set(recording(standing_positions()), "x")
    assert draft.against == ()
    turned = rotated_about(standing_positions(), "R.Knee.Lat", "R.Knee.Med", 42.0)
    draft = draft_marker_set(recording(turned), "x")
    assert len(draft.against) == 1
    assert f"# NOTE: this cannot be right: {draft.against[0]}." in draft.text
