"""Mistakes in the files of the measured walk that comes with the package are named by `check`, and refused by a fit."""

import json
import re

import numpy as np
import pytest

from command_line import run
from kinertia.errors import TrialError
from kinertia.io.subject_file import read_subject
from kinertia.report.faults import counts, faults_markdown, save_faults
from kinertia.studies.faults import (
    FaultOutcome,
    Finding,
    JointMoments,
    SoundWalk,
    change,
    checked,
    judged,
    outcome_of,
    run_faults,
    run_sound,
    sound_laboratories,
    synthetic_walk,
)
from kinertia.synthetic.measured_person import read_person, write_person
from kinertia.synthetic.mistakes import MISTAKES, Mistake
from kinertia.workflow.from_files import prepare_subject
from one_process import in_one_process

NOT_POSSIBLE = {
    "outer and inner knee markers swapped in the static trial, one leg",
    "outer and inner ankle markers swapped in the static trial, one leg",
    "outer and inner elbow markers swapped in the static trial, one arm",
}
"""Plug-in Gait has no inner markers."""
LEFT_TO_THE_FIT = {
    "plates turned by 3 degrees about the vertical",
    "the other sex",
}
"""What `check` says nothing about: the study in `docs/faults.md` tells what becomes of it."""
QUICK_EVERY = 6


@pytest.fixture(scope="module")
def person(c3d_lab):
    return read_person(read_subject(c3d_lab / "subject.toml"), np.random.default_rng(1))


@pytest.fixture(scope="module")
def sound(person, tmp_path_factory):
    """What is said of the walk as it is: nothing."""
    findings = checked(write_person(tmp_path_factory.mktemp("sound"), person))
    assert findings == []
    return findings


CASES = [
    pytest.param(mistake, id=mistake.name, marks=[] if k % QUICK_EVERY == 0 else [pytest.mark.slow])
    for k, mistake in enumerate(MISTAKES)
]


def test_fifty_mistakes():
    assert len({mistake.name for mistake in MISTAKES}) == len(MISTAKES) == 50


@pytest.mark.parametrize("mistake", CASES)
def test_mistakes_are_named(mistake, person, sound, tmp_path):
    spoilt = mistake.change(person, np.random.default_rng(5))
    assert (spoilt is None) == (mistake.name in NOT_POSSIBLE)
    if spoilt is None:
        return
    judgement = judged(mistake, sound, checked(write_person(tmp_path, spoilt)))
    if mistake.name in LEFT_TO_THE_FIT:
        assert judgement is None
    else:
        assert judgement is not None
        assert judgement[0] == "named", judgement[1]


@pytest.mark.parametrize("name", ["all left and right labels swapped", "forces 100 ms late"])
def test_a_fit_refuses_what_check_refuses(name, person, sound, tmp_path):
    mistake = next(one for one in MISTAKES if one.name == name)
    path = write_person(tmp_path, mistake.change(person, np.random.default_rng(5)))
    (level, sentence, _), *_ = checked(path)
    assert level == "fail"
    with pytest.raises(TrialError) as refused:
        prepare_subject(path)
    assert refused.value.problem == sentence


def test_judgement():
    mistake = Mistake("x", lambda person, rng: person, "zero")
    known = [Finding("caution", "2.0 % off")]
    assert judged(mistake, known, [Finding("caution", "3.5 % off")]) is None
    assert judged(mistake, known, [Finding("fail", "3.5 % off")]) == ("warned", "3.5 % off")
    two, one = (Finding("caution", f"plate 1: {rest}; check it") for rest in ("x: 9 mm, gain: 4 %", "gain: 5 %"))
    assert judged(mistake, [two], [one]) is None
    assert judged(mistake, [one], [two]) == ("warned", two.sentence)
    cautioned, failed = Finding("caution", "the zero is wrong"), Finding("fail", "no frame")
    assert judged(mistake, known, [cautioned]) == ("named", cautioned.sentence)
    assert judged(mistake, known, [cautioned, failed]) == ("warned", failed.sentence)
    assert judged(mistake, [Finding("caution", "zero 1 N")], [Finding("caution", "zero 9 N")]) == ("named", "zero 9 N")


def test_changes_are_counted_in_deviations():
    time = np.arange(5.0)
    sound = JointMoments(time, ("hip", "knee"), np.zeros((5, 2)), np.array([[2.0, 1.0]] * 5))
    other = JointMoments(time[1:4] + 0.5, ("hip", "knee"), np.array([[3.0, 1.0]] * 3), np.ones((3, 2)))
    assert change(sound, other) == (1.5, 3.0)
    assert change(None, other)[0] != change(None, other)[0]
    assert change(sound, JointMoments(time + 9, ("hip", "knee"), np.zeros((5, 2)), np.ones((5, 2))))[0] == np.inf


@pytest.fixture
def outcomes():
    """Of two walks and three mistakes, made up."""
    walks = [
        SoundWalk("one", None, (), None),
        SoundWalk("other", None, (Finding("caution", "mass"), Finding("caution", "plate", "fit")), None),
    ]
    of_mistakes = [
        FaultOutcome("one", "a", "named", "said", "check"),
        FaultOutcome("other", "a", "named", "said", "fit", 2.0, 3.0),
        FaultOutcome("one", "b", "silent", "", "", 2.0, 3.0),
        FaultOutcome("other", "b", "not possible"),
        FaultOutcome("one", "c", "harmless", "", "", 0.5, 1.0),
        FaultOutcome("other", "c", "warned", "other", "check"),
    ]
    laboratories = [SoundWalk("laboratory 1", None, (), JointMoments(None, (), None, None))]
    return walks, of_mistakes, laboratories


def test_page(outcomes, tmp_path):
    page = faults_markdown(*outcomes)
    assert "| a | named | named \\* |" in page
    assert "| b | **silent** | – |" in page
    assert "Of 5 mistakes made, 2 are named (40 %), 1 warned of with another cause, 1 harmless, and 1 do silent" in page
    assert "| **named / possible** | **1 / 3** | **1 / 2** |" in page
    assert "| none: the walk as it is | nothing said | 1 by check; 1 by fit |" in page
    assert "Of 2 sound walks 2 are refused. Of 1 other synthetic people in sound laboratories 0 are refused" in page
    assert "- one: nothing\n- other: mass (check); plate (fit)\n- laboratory 1: nothing" in page
    assert counts(outcomes[1]) == {"named": 2, "warned": 1, "harmless": 1, "silent": 1}
    content = json.loads((save_faults(*outcomes, tmp_path / "out") / "faults.json").read_text())
    assert content["outcomes"][0]["change_nm"] is None
    assert content["sound"]["other"][1]["by"] == "fit"


def test_command(outcomes, c3d_lab, tmp_path, monkeypatch):
    asked = {}
    monkeypatch.setattr("kinertia.cli.study.run_faults", lambda walks, **_: asked.update(walks) or outcomes[:2])
    monkeypatch.setattr("kinertia.cli.study.sound_laboratories", lambda folder, count: {})
    monkeypatch.setattr("kinertia.cli.study.run_sound", lambda people, *_: outcomes[2])
    outcome = run("study", "faults", c3d_lab / "subject.toml", "-o", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    assert list(asked) == ["synthetic walk", "synthetic walker"]
    assert "silent: one: b" in outcome.out
    assert re.search(r"named\s+1\s+1", outcome.out)
    assert (tmp_path / "out" / "faults.md").is_file()


@pytest.mark.slow
@in_one_process()
def test_sound_laboratories_are_not_doubted(tmp_path):
    """Two people whose bodies, markers and plates differ as those of sound laboratories do."""
    people = run_sound(sound_laboratories(tmp_path, 2))
    assert [one.findings for one in people] == [(), ()]
    moments = [one.moments.moment_nm for one in people]
    assert moments[0].shape != moments[1].shape or np.abs(moments[0] - moments[1]).max() > 1.0


@pytest.mark.slow
@in_one_process()
def test_study_of_a_walk(tmp_path):
    """One mistake that check names, one that the fit has to look at."""
    wanted = {"forces in kg", "the other sex"}
    picked = [one for one in MISTAKES if one.name in wanted]
    (sound,), outcomes_of_faults = run_faults({"walk": synthetic_walk(tmp_path / "lab")}, picked)
    assert sound.moments is not None
    assert not any(one.level == "fail" for one in sound.findings)
    by_name = {one.mistake: one for one in outcomes_of_faults}
    assert (by_name["forces in kg"].outcome, by_name["forces in kg"].by) == ("named", "check")
    other = by_name["the other sex"]
    assert other.outcome in ("harmless", "named", "warned")
    assert other.change_sd < 1.0
    assert outcome_of(sound, Mistake("none", lambda person, rng: None, "")).outcome == "not possible"
