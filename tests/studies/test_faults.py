"""Faults in the files of a synthetic walk are identified by `check`, and block a fit."""

import json

import numpy as np
import pytest

from found import FAULTY
from kinertia.errors import BlockedError
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.findings.rule import all_rules
from kinertia.io.subject.reader import read_subject
from kinertia.workflow.from_files import prepare_subject
from one_process import in_one_process
from validation import faults
from validation.fault_study import (
    FaultOutcome,
    JointMoments,
    SoundWalk,
    change,
    checked,
    judged,
    outcome_of,
    reported,
    run_faults,
    run_sound,
    sound_laboratories,
    synthetic_walk,
)
from validation.faults import code_rows, counts, faults_markdown, faults_summary
from validation.measured_person import read_person, write_person
from validation.mistakes import MISTAKES, Mistake
from validation.walks import subject_files

NOT_POSSIBLE = {
    "lateral and medial knee markers swapped in the static trial, one leg",
    "lateral and medial ankle markers swapped in the static trial, one leg",
    "lateral and medial elbow markers swapped in the static trial, one arm",
    "medial knee markers swapped between the legs in the static trial",
}
"""Plug-in Gait has no inner markers."""
LEFT_TO_THE_FIT = {
    "centres of pressure 50 mm off along X, both plates",
    "cameras tilted by 3 degrees to one side",
    "plates turned by 3 degrees about the vertical",
    "one plate turned by 5 degrees about the vertical",
    "the other sex",
}
"""What `check` says nothing about: the study in `docs/validation/faults.md` tells what becomes of it."""
QUICK_EVERY = 6
CASE = FaultOutcome("walk", "fault", "not possible")


@pytest.fixture(scope="module")
def person(c3d_lab):
    return read_person(read_subject(c3d_lab / "subject.toml"), np.random.default_rng(1))


@pytest.fixture(scope="module")
def sound(person, tmp_path_factory):
    """The walk as it is, in which nothing is found."""
    findings = checked(write_person(tmp_path_factory.mktemp("sound"), person))
    assert reported(findings) == []
    return findings


CASES = [
    pytest.param(mistake, id=mistake.name, marks=[] if k % QUICK_EVERY == 0 else [pytest.mark.slow])
    for k, mistake in enumerate(MISTAKES)
]


def test_mistakes_have_names_of_their_own():
    assert len({mistake.name for mistake in MISTAKES}) == len(MISTAKES)


@pytest.mark.parametrize("mistake", CASES)
def test_mistakes_are_named(mistake, person, sound, tmp_path):
    spoilt = mistake.change(person, np.random.default_rng(5))
    assert (spoilt is None) == (mistake.name in NOT_POSSIBLE)
    if spoilt is None:
        return
    judgement = judged(CASE, mistake, sound, checked(write_person(tmp_path, spoilt)), "check")
    if mistake.name in LEFT_TO_THE_FIT:
        assert judgement is None
    else:
        assert judgement is not None
        assert judgement.outcome == "identified", judgement.code


@pytest.mark.parametrize("name", ["all left and right labels swapped", "forces 100 ms late"])
def test_a_fit_is_blocked_by_what_blocks_check(name, person, tmp_path):
    mistake = next(candidate for candidate in MISTAKES if candidate.name == name)
    path = write_person(tmp_path, mistake.change(person, np.random.default_rng(5)))
    errors = {
        found_finding.code for found_finding in reported(checked(path)) if found_finding.severity is Severity.ERROR
    }
    with pytest.raises(BlockedError) as blocked:
        prepare_subject(path)
    assert {found_finding.code for found_finding in blocked.value.blocking} == errors
    assert errors & mistake.codes


def test_every_fault_has_codes_of_the_catalogue():
    assert {code for candidate in MISTAKES for code in candidate.codes} <= set(all_rules())
    assert [candidate.name for candidate in MISTAKES if not candidate.codes] == ["the other sex"]


WALK, ZERO_FAULT = Where(trial="walk", plate="plate 1"), Mistake("x", lambda person, rng: person, frozenset({"P213"}))


def outcome(before, after):
    """Outcome and code of a fault of the zero."""
    judgement = judged(CASE, ZERO_FAULT, before, after, "check")
    return None if judgement is None else (judgement.outcome, judgement.code)


def test_a_new_code_of_the_fault_names_it_whatever_else_is_new():
    jump, zero = finding("M112", Where(trial="walk"), Severity.ERROR), finding("P213", WALK)
    assert outcome([], [jump]) == ("warned", "M112")
    assert outcome([], [jump, zero]) == ("identified", "P213")
    assert outcome([jump], [jump, zero]) == ("identified", "P213")
    assert outcome([], [zero.muted("P211")]) is None
    assert outcome([], [finding("R111", Where(trial="walk"))]) is None, "an assumption"


def test_what_is_found_without_the_fault_is_new_where_it_is_worse_or_another_size():
    zero = finding("P213", WALK)
    assert outcome([zero], [zero]) is None
    assert outcome([zero], [zero.at(Severity.ERROR)]) == ("identified", "P213")
    small, alike, large = (finding("P213", WALK, level_n=Quantity(value, "N", sd=1.0)) for value in (5.0, 7.0, 9.0))
    assert outcome([small], [alike]) is None
    assert outcome([small], [large]) == ("identified", "P213")


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
        SoundWalk("one", None, (), (), None),
        SoundWalk("other", None, FAULTY, FAULTY, JointMoments(None, (), None, None)),
    ]
    of_mistakes = [
        FaultOutcome("one", "a", "identified", "P213", "said", "check"),
        FaultOutcome("other", "a", "identified", "P215", "said", "fit", 2.0, 3.0),
        FaultOutcome("one", "b", "unnoticed", change_sd=2.0, change_nm=3.0),
        FaultOutcome("other", "b", "not possible"),
        FaultOutcome("one", "c", "harmless", change_sd=0.5, change_nm=1.0),
        FaultOutcome("other", "c", "warned", "M113", "other", "check"),
    ]
    laboratories = [SoundWalk("laboratory 1", None, (), (), JointMoments(None, (), None, None))]
    return walks, of_mistakes, laboratories


def test_page(outcomes):
    page = faults_markdown(*outcomes)
    assert "| a | identified | identified \\* |" in page
    assert "| b | **unnoticed** | – |" in page
    assert "Of 5 faults, 2 are identified (40 %), 1 reported with other codes, 1 harmless, and 1 unnoticed." in page
    assert "| **identified / possible** | **1 / 3** | **1 / 2** |" in page
    assert "| none: the walk as it is | none | M113 P213 T214 P215 |" in page
    assert "Of 2 fault-free walks 1 are blocked, and 2 have a warning." in page
    assert "- one: nothing\n- other: M113 " in page
    assert counts(outcomes[1]) == {"identified": 2, "warned": 1, "harmless": 1, "unnoticed": 1}
    content = json.loads(json.dumps(faults_summary(*outcomes)))
    assert content["outcomes"][0]["change_nm"] is None
    assert [found_finding["code"] for found_finding in content["sound"]["other"]] == [
        found_finding.code for found_finding in FAULTY
    ]


def test_codes_are_counted(outcomes):
    walks, of_faults, laboratories = outcomes
    rows = {code: tuple(map(int, numbers)) for code, _, *numbers in code_rows([*walks, *laboratories], of_faults)}
    assert rows == {"M113": (0, 1, 1), "P213": (1, 0, 1), "P215": (1, 0, 1), "T214": (0, 0, 1)}


def test_own_walks_are_printed_and_leave_the_page_alone(outcomes, c3d_lab, tmp_path, monkeypatch, capsys):
    asked = {}
    monkeypatch.setattr(faults, "run_faults", lambda walks, **_: asked.update(walks) or outcomes[:2])
    monkeypatch.setattr(faults, "sound_laboratories", lambda folder, count: {})
    monkeypatch.setattr(faults, "run_sound", lambda people, *_: outcomes[2])
    monkeypatch.setattr(faults, "write_page", None)
    faults.main([c3d_lab / "subject.toml"], tmp_path / "details.json")
    assert list(asked) == ["synthetic walk", "synthetic walker"]
    assert "| b | **unnoticed** | – |" in capsys.readouterr().out
    assert json.loads((tmp_path / "details.json").read_text())["outcomes"][2]["outcome"] == "unnoticed"


def test_measured_walks_have_subject_files(measured_folder, tmp_path):
    people = faults.named(map(read_subject, subject_files(measured_folder, tmp_path)))
    assert len(people) == 5
    for wanted in people.values():
        assert all(path.is_file() for path in (wanted.model.static, wanted.trials[0].markers))


@pytest.mark.slow
@in_one_process()
def test_sound_laboratories_are_not_doubted(tmp_path):
    """Two people whose bodies, markers and plates differ as those of sound laboratories do."""
    people = run_sound(sound_laboratories(tmp_path, 2))
    assert [
        [
            found_finding.code
            for found_finding in reported(walked.findings)
            if found_finding.severity > Severity.CORRECTED
        ]
        for walked in people
    ] == [
        [],
        [],
    ]
    moments = [walked.moments.moment_nm for walked in people]
    assert moments[0].shape != moments[1].shape or np.abs(moments[0] - moments[1]).max() > 1.0


@pytest.mark.slow
@in_one_process()
def test_study_of_a_walk(tmp_path):
    """One mistake that check names, one that the fit has to look at."""
    wanted = {"forces in kg", "the other sex"}
    picked = [candidate for candidate in MISTAKES if candidate.name in wanted]
    (sound,), outcomes_of_faults = run_faults({"walk": synthetic_walk(tmp_path / "lab")}, picked)
    assert sound.moments is not None
    assert not any(answer.severity is Severity.ERROR for answer in reported(sound.findings))
    by_name = {outcomes_of_fault.mistake: outcomes_of_fault for outcomes_of_fault in outcomes_of_faults}
    assert (by_name["forces in kg"].outcome, by_name["forces in kg"].by) == ("identified", "check")
    other = by_name["the other sex"]
    assert other.outcome in ("harmless", "identified", "warned")
    assert other.change_sd < 1.0
    assert outcome_of(sound, Mistake("none", lambda person, rng: None, frozenset())).outcome == "not possible"
