"""A fit without a static trial: S207, wider priors, and legs as the static trial has them."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import BlockedError
from kinertia.estimation.simultaneous.instruments.priors import WITHOUT_STATIC
from kinertia.io.recording import read_recording
from kinertia.model.gait27 import LEG_AXIS_TILTS
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
    found = [finding.to_dict() for finding in check_person(person).findings if finding.code == "S207"]
    result = prepared(screen(person), Settings())
    assert [finding.to_dict() for finding in result.findings if finding.code == "S207"] == found
    return result


def test_a_trial_without_markers_on_knees_and_ankles_cannot_stand_for_it(synthetic_lab):
    """As runs whose anatomical markers are in the static trial only."""
    walk = read_recording(synthetic_lab / "walk.c3d")
    worn = [label for label in walk.markers.labels if label not in ("RKNE", "RANK")]
    subject = Subject(name="one", mass_kg=72.6, height_m=HEIGHT_M, sex="male")
    run = replace(walk, markers=walk.markers.select(worn))
    person = Person(subject, [TrialInput(run)], None)
    (found,) = [finding for finding in check_person(person).findings if finding.code == "S208"]
    assert found.evidence["landmarks"].value == "ankle_lateral_r, knee_lateral_r"
    with pytest.raises(BlockedError) as caught:
        prepared(screen(person), Settings())
    assert "S208" in [finding.code for finding in caught.value.blocking]


def test_a_walk_stands_for_its_static_trial(synthetic_lab):
    without = ready(synthetic_lab, None)
    usual = ready(synthetic_lab, read_recording(synthetic_lab / "static.c3d"))
    assert [finding.severity.name for finding in without.findings if finding.code == "S207"] == ["WARNING"]
    assert "S207" not in {finding.code for finding in usual.findings}
    for name, sd_m in usual.uncertainty.centres.items():
        assert without.uncertainty.centres[name] == pytest.approx(WITHOUT_STATIC * sd_m)
    assert without.uncertainty.marker_sd_m == pytest.approx(WITHOUT_STATIC * usual.uncertainty.marker_sd_m)
    free = {name.split("_")[0] for name in without.uncertainty.axes}
    assert free == {"knee", "elbow"}, "one walk does not show the axes of ankles"
    tilts = {name: without.skeleton.locked[name] for name in LEG_AXIS_TILTS}
    assert max(map(abs, tilts.values())) < np.radians(15.0), tilts
    for mine, expected in zip(without.skeleton.joints, usual.skeleton.joints, strict=True):
        if mine.child.startswith(("thigh", "shank", "talus")):
            assert np.linalg.norm(np.subtract(mine.translation, expected.translation)) < 0.02, mine.child
