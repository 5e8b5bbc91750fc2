"""A fit without a static trial: S207, wider priors, and legs as the static trial has them."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.model_uncertainty import WITHOUT_STATIC
from kinertia.io.recording import read_recording
from kinertia.settings import Settings, Subject
from kinertia.synthetic.walk import HEIGHT_M
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.check import check_person
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepared
from kinertia.workflow.screening import screen


def ready(lab, static):
    subject = Subject(name="one", mass_kg=72.6, height_m=HEIGHT_M, sex="male")
    person = Person(subject, [TrialInput(read_recording(lab / "walk.c3d"))], static)
    found = [one.to_dict() for one in check_person(person).findings if one.code == "S207"]
    result = prepared(screen(person), Settings())
    assert [one.to_dict() for one in result.findings if one.code == "S207"] == found
    return result


def test_a_walk_stands_for_its_static_trial(synthetic_lab):
    without = ready(synthetic_lab, None)
    usual = ready(synthetic_lab, read_recording(synthetic_lab / "static.c3d"))
    assert [one.severity.name for one in without.findings if one.code == "S207"] == ["WARNING"]
    assert "S207" not in {one.code for one in usual.findings}
    for name, sd_m in usual.uncertainty.centres.items():
        assert without.uncertainty.centres[name] == pytest.approx(WITHOUT_STATIC * sd_m)
    assert without.uncertainty.axes
    for mine, expected in zip(without.skeleton.joints, usual.skeleton.joints, strict=True):
        if mine.child.startswith(("thigh", "shank", "talus")):
            assert np.linalg.norm(np.subtract(mine.translation, expected.translation)) < 0.02, mine.child
