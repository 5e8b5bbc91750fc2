import json
from dataclasses import replace

import numpy as np
import pytest

from command_line import run
from kinertia.errors import KinertiaError
from kinertia.estimation.prior import literature_prior
from kinertia.settings import Settings, Subject
from kinertia.studies.cross_validation import cross_validate, frozen
from kinertia.synthetic.laboratory import PERFECT, LabNoise, record, write_lab
from kinertia.synthetic.walk import HEIGHT_M, MASS_KG, SEX, walk, walking_subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare

WALK_S, RATE_HZ = 2.7, 60.0
SUBJECT = Subject(name="walker", sex=SEX, mass_kg=MASS_KG, height_m=HEIGHT_M)


@pytest.fixture(scope="module")
def person():
    subject = walking_subject()
    return replace(subject, bsp=literature_prior(subject.literature).draw(np.random.default_rng(4)))


@pytest.fixture(scope="module")
def recordings(person):
    """Two walks of the same person, begun at different times of the stride."""
    noise = LabNoise(skin="none", camera_sd_m=0.002)
    return [
        record(person, walk(person, WALK_S, RATE_HZ, start), noise, np.random.default_rng(k))
        for k, start in enumerate((0.75, 0.25))
    ]


@pytest.mark.slow
def test_own_parameters_explain_another_walk_better_than_the_literature_s(recordings):
    inputs = [TrialInput(replace(lab.walk, name=name)) for lab, name in zip(recordings, ("one", "two"), strict=True)]
    held_out = cross_validate(prepare(Person(SUBJECT, inputs, recordings[0].static), Settings()))
    assert [held.trial for held in held_out] == ["one", "two"]
    assert held_out[0].others == ("two",)
    for held in held_out:
        assert held.estimate.objective < held.literature.objective
        assert 0.0 < held.estimate.force_rms_n < 20.0
        assert 0.0005 < held.estimate.marker_rms_m < 0.01


def test_frozen_parameters_stay(person):
    prior = literature_prior(person.literature)
    kept = frozen(prior, person.bsp)
    assert kept.mean is person.bsp
    assert kept.sd == pytest.approx(1e-3 * prior.sd)
    assert kept.mass_kg == person.bsp.total_mass_kg


def test_one_trial_cannot_be_held_out(recordings):
    with pytest.raises(KinertiaError, match=r"at least two trials.*the subject has 1"):
        cross_validate(prepare(Person(SUBJECT, [TrialInput(recordings[0].walk)], recordings[0].static), Settings()))


@pytest.mark.slow
def test_command(person, tmp_path):
    lab = record(person, walk(person, WALK_S, RATE_HZ, 0.75), PERFECT, np.random.default_rng(0))
    subject = write_lab(tmp_path / "lab", lab)
    alone = run("crossval", subject, "-o", tmp_path / "out")
    assert alone.status == 2
    assert "at least two trials" in alone.err
    text = subject.read_text()
    text += '\n[[trial]]\nname = "again"\nmarkers = "walk.trc"\nforces = "walk_grf.mot"\n'
    subject.write_text(text)
    outcome = run("crossval", subject, "-o", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    content = json.loads((tmp_path / "out" / "crossval.json").read_text())
    assert {held["trial"] for held in content["held_out"]} == {"walk", "again"}
    assert "2 of 2" in outcome.out
