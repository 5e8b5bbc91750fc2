"""Where joint widths come from."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.settings import Settings, Subject
from kinertia.trial.data import Markers, Recording
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.joint_widths import with_widths
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepared
from kinertia.workflow.screening import screen

SET = read_marker_set("plug-in-gait")


def recording(name, **measurements):
    return Recording(name, Markers(np.zeros(1), ("A",), np.zeros((1, 1, 3))), measurements=measurements)


def widths(static, trials, **given):
    static_with_widths, marker_set = with_widths(static, trials, SET, Subject(name="A", **given))
    known = {joint: static_with_widths.measurements.get(name) for joint, name in marker_set.widths.items()}
    borrowed = [(one.code, one.where.part, one.where.file) for one in static_with_widths.findings]
    return {joint: value for joint, value in known.items() if value}, borrowed


def test_the_static_trial_goes_before_others_and_the_subject_file_before_both():
    static = recording("static", RKneeWidth=0.10)
    walk = recording("walk", RKneeWidth=0.2, LKneeWidth=0.11, LAnkleWidth=0.07)
    by_joint, borrowed = widths(static, [recording("empty"), walk])
    assert by_joint == {"knee_r": 0.10, "knee_l": 0.11, "ankle_l": 0.07}
    assert borrowed == [("S105", "left knee", "walk"), ("S105", "left ankle", "walk")]
    by_joint, borrowed = widths(static, [walk], knee_width_mm=95.0)
    assert by_joint == {"knee_r": 0.095, "knee_l": 0.095, "ankle_l": 0.07}
    assert borrowed == [("S105", "left ankle", "walk")]


def test_a_set_that_names_no_widths_takes_those_of_the_subject_file():
    unnamed = replace(SET, widths={})
    static, marker_set = with_widths(recording("static"), [], unnamed, Subject(name="A", ankle_width_mm=70.0))
    assert {joint: static.measurements[name] for joint, name in marker_set.widths.items()} == pytest.approx(
        {"ankle_r": 0.07, "ankle_l": 0.07}
    )


def test_the_model_has_the_widths_of_the_subject_file(measured_folder):
    """The static trial has widths of its own, of 105 mm at the knees."""
    folder = measured_folder / "pig_c3d"
    static, walk = (read_recording(folder / f"subject_b_{name}.c3d") for name in ("static", "walk"))

    def shank_m(**given):
        subject = Subject(name="B", mass_kg=47.5, height_m=1.505, sex="female", **given)
        skeleton = prepared(screen(Person(subject, [TrialInput(walk)], static)), Settings(joint_axes=False)).skeleton
        return {joint.child: np.array(joint.translation) for joint in skeleton.joints}["shank_r"]

    usual, same, wide = shank_m(), shank_m(knee_width_mm=105.0), shank_m(knee_width_mm=140.0)
    assert same == pytest.approx(usual, abs=1e-9)
    assert np.linalg.norm(wide - usual) > 0.002
