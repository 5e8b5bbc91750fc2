"""Why moments differ from Vicon's in the file: a cause is named where it was put in, and only there."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia import load_fit
from kinertia.motion.joint_moments import component_signs, joint_wrenches, leg_joints
from kinertia.report.pages.page import render
from kinertia.report.pages.vicon_differences import COMPONENTS, curve_differences, differences_view
from kinertia.trial.file_contents import FileOutputs

CENTRES = {"Hip": "FEP", "Knee": "FEO", "Ankle": "TIO"}
SEGMENTS = {"Hip": "FE", "Knee": "TI", "Ankle": "FO"}


def as_vicon_has_it(fit, moved_m=(0.0, 0.0, 0.0), turned_deg=0.0, body=None, gain=1.0, added=None, points=True):
    """The fit as if its file held moments of Vicon's whose centres are moved, axes turned, segments or forces others.

    Forces of the fit, which it has corrected, are `gain` times those measured. `added` is a curve over time, N m/kg.
    """
    (trial,) = fit.trials
    curve, skeleton = trial.joint_curves, trial.skeleton
    pose, joints = skeleton.pose(curve.motion.q), leg_joints(skeleton)
    loads = trial.reactions.at(curve.time)
    wrenches = joint_wrenches(skeleton, body or fit.estimate, curve.motion, loads, joints)
    turn = Rotation.from_euler("y", turned_deg, degrees=True).as_matrix()
    values, places = {}, {}
    for joint in joints:
        centre = joint.centre(skeleton, pose)
        axes = pose.rotation[:, skeleton.segments.index(joint.child)]
        about, along = centre + np.array(moved_m), axes @ turn
        wrench, side = wrenches[joint], joint.side.upper()
        moment = wrench[:, 3:] + np.cross(centre - about, wrench[:, :3])
        moment = -component_signs(joint) * np.einsum("nka,nk->na", along[:, :, [2, 0, 1]], moment) / fit.mass_kg
        values[f"{side}{joint.name}Moment"] = moment + (0.0 if added is None else added(curve.time)[:, None])
        places[side + CENTRES[joint.name]] = about
    for joint in joints:
        side, segment = joint.side.upper(), SEGMENTS[joint.name]
        along = pose.rotation[:, skeleton.segments.index(joint.child)] @ turn
        origin = places.get(f"{side}{segment}O", places[side + CENTRES[joint.name]])
        ends = {f"{side}{segment}{letter}": origin + 0.1 * along[:, :, k] for k, letter in enumerate("APL")}
        places |= {f"{side}{segment}O": origin, **ends, f"{side}FEP": places[f"{side}FEP"]}
    outputs = FileOutputs(curve.time, values, places if points else {})
    stated = replace(trial.kinematics, trial=replace(trial.kinematics.trial, outputs=outputs))
    reactions = replace(trial.reactions, wrench=gain * trial.reactions.wrench)
    return replace(fit, trials=(replace(trial, kinematics=stated, reactions=reactions),))


def heavier(body, ratio):
    return replace(body, mass_kg=ratio * body.mass_kg, inertia_kgm2=ratio * body.inertia_kgm2)


def difference_of(fit, joint, component, side="r"):
    (found,) = [
        curve_difference
        for curve_difference in curve_differences(fit)
        if (curve_difference.joint, curve_difference.component, curve_difference.side) == (joint, component, side)
    ]
    return found


def test_the_same_moments_are_within_the_error_bars(fit):
    found = curve_differences(as_vicon_has_it(fit))
    assert len(found) == 2 * 3 * len(COMPONENTS)
    assert {difference.cause for difference in found} == {"within"}
    assert max(difference.bars for difference in found) < 0.5
    assert max(difference.apart_mm for difference in found) < 1e-6


def test_another_joint_centre(fit):
    found = difference_of(as_vicon_has_it(fit, moved_m=(0.0, 0.0, 0.06)), "Hip", "adduction")
    assert (found.cause, found.tried) == ("centre", True)
    assert found.explained > 0.9
    assert found.bars > 1.0
    assert found.apart_mm == pytest.approx(60.0, abs=0.1)


def test_other_axes(fit):
    found = difference_of(as_vicon_has_it(fit, turned_deg=25.0), "Ankle", "rotation")
    assert found.cause in ("axes", "within")
    turned = [
        curve_difference
        for curve_difference in curve_differences(as_vicon_has_it(fit, turned_deg=25.0))
        if curve_difference.cause != "within"
    ]
    assert turned
    assert {difference.cause for difference in turned} == {"axes"}
    assert found.apart_deg == pytest.approx(25.0, abs=0.1)


def test_corrected_forces(fit):
    changed = [
        curve_difference
        for curve_difference in curve_differences(as_vicon_has_it(fit, gain=1.3))
        if curve_difference.cause != "within"
    ]
    assert {difference.joint for difference in changed} >= {"Ankle"}
    assert {difference.cause for difference in changed} == {"forces"}


def test_other_segments(fit):
    body = heavier(fit.literature, 3.0)
    other = as_vicon_has_it(replace(fit, literature=body), body=body)
    changed = [curve_difference for curve_difference in curve_differences(other) if curve_difference.cause != "within"]
    assert changed
    assert {difference.cause for difference in changed} == {"tables"}


def test_unfiltered_moments(fit):
    fast = as_vicon_has_it(fit, added=lambda time: 0.5 * np.cos(np.pi * np.round((time - time[0]) * 100.0)))
    assert {curve_difference.cause for curve_difference in curve_differences(fast)} == {"filter"}


def test_what_nothing_explains_has_no_cause(fit):
    slow = as_vicon_has_it(fit, added=lambda time: np.full_like(time, 0.5))
    found = curve_differences(slow)
    assert {difference.cause for difference in found} == {""}
    assert all(np.isnan(difference.explained) for difference in found)


def test_without_vicons_points_centres_and_axes_are_not_accused(fit):
    found = curve_differences(as_vicon_has_it(fit, moved_m=(0.0, 0.0, 0.06), turned_deg=25.0, points=False))
    assert not any(difference.tried for difference in found)
    assert not {difference.cause for difference in found} & {"centre", "axes", "together"}


def test_the_report_shows_a_row_per_curve(fit):
    assert 'id="vicon"' not in render(fit)
    assert differences_view(fit) is None
    other = as_vicon_has_it(fit, moved_m=(0.0, 0.0, 0.06))
    view = differences_view(other)
    assert [row["curve"] for row in view["rows"][:4]] == [
        "Hip flexion",
        "Hip adduction",
        "Hip rotation",
        "Knee flexion",
    ]
    assert "hip centre, 60 and 60 mm apart" in view["rows"][1]["cause"]
    assert 'id="vicon"' in render(other)


def test_a_file_with_curves_of_one_side_only(fit):
    """As where the other foot is on no plate."""
    (trial,) = as_vicon_has_it(fit).trials
    outputs = trial.kinematics.trial.outputs
    left = replace(outputs, values={name: value for name, value in outputs.values.items() if name.startswith("L")})
    stated = replace(trial.kinematics, trial=replace(trial.kinematics.trial, outputs=left))
    page = render(replace(fit, trials=(replace(trial, kinematics=stated),)))
    row = page[page.index('id="vicon"') :].partition("Hip flexion")[2].partition("</tr>")[0]
    right, left_cell = row.split('<td class="number">')[1:3]
    assert right.startswith("–")
    assert left_cell[0].isdigit()


@pytest.mark.measured
def test_of_a_measured_walk(fit_of):
    """Feet of this file have axes that are 11 degrees from Kinertia's, and all else is within the error bars."""
    found = difference_of(load_fit(fit_of("pig_b").folder), "Ankle", "rotation")
    assert found.cause == "axes"
    assert found.explained > 0.9
    assert 8.0 < found.apart_deg < 14.0
