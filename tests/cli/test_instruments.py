"""`kinertia instruments`: what people of a session say of plates and clock, and fits that know it."""

import re

import numpy as np
import pytest

from command_line import run
from kinertia.errors import SessionError
from kinertia.io.subject.learnt_files import PersonInstruments, read_session
from kinertia.io.subject.reader import read_subject
from kinertia.settings import Instruments
from kinertia.workflow.from_files import check_plates, prepare_subject
from kinertia.workflow.session import session_instruments


@pytest.fixture(scope="module")
def session(c3d_lab, tmp_path_factory):
    """The file of the measured walk alone, and the outcome of the command."""
    path = tmp_path_factory.mktemp("session") / "instruments.toml"
    return path, run("instruments", c3d_lab / "subject.toml", "-o", path)


def subject_with(folder, c3d_lab, entries):
    """The measured walk's subject file with these lines under [instruments]."""
    text = (c3d_lab / "subject.toml").read_text(encoding="utf-8")
    for name in ("static.c3d", "walk.c3d"):
        text = text.replace(f'"{name}"', f'"{(c3d_lab / name).as_posix()}"')
    path = folder / "subject.toml"
    path.write_text(f"{text}\n[instruments]\n{entries}\n", encoding="utf-8")
    return path


@pytest.mark.slow
def test_the_command_writes_what_it_shows(session):
    path, outcome = session
    assert outcome.status == 0, outcome.err
    (person,) = read_session(path)
    assert person.plates == ("plate 1", "plate 2")
    shown = re.search(r"plate 2\s+gain\s+([+-][\d.]+)\s+([\d.]+)\s+%", outcome.out)
    written = re.search(r'\[found\."plate 2"\].*?gain_percent = ([-\d.]+)', path.read_text(encoding="utf-8"), re.DOTALL)
    assert float(shown[1]) == pytest.approx(float(written[1]), abs=0.06)
    assert np.linalg.eigvalsh(np.array(person.information))[0] > -1e-6


@pytest.mark.slow
def test_a_fit_leaves_out_what_it_has_said_itself(session, c3d_lab, tmp_path):
    path, _ = session
    own = prepare_subject(subject_with(tmp_path, c3d_lab, f'session = "{path.as_posix()}"'))
    assert own.uncertainty.instruments.session == ()
    (said,) = [one for one in own.findings if one.code == "S408"]
    assert "1 person (synthetic walker) left out" in said.evidence["source"].value
    (person,) = read_session(path)
    text = path.read_text(encoding="utf-8")
    for known in person.files:
        text = text.replace(known, f"of somebody else: {known}")
    (tmp_path / "others.toml").write_text(text, encoding="utf-8")
    helped = prepare_subject(subject_with(tmp_path, c3d_lab, 'session = "others.toml"'))
    (information,) = helped.uncertainty.instruments.session
    np.testing.assert_array_equal(information.information, person.information)
    (tmp_path / "elsewhere.toml").write_text(text.replace('"plate 1", "plate 2"', '"left", "right"'), encoding="utf-8")
    with pytest.raises(SessionError, match="none of the session's plates") as caught:
        prepare_subject(subject_with(tmp_path, c3d_lab, 'session = "elsewhere.toml"'))
    assert caught.value.finding.code == "S502"


def test_what_the_laboratory_states_is_used_and_checked(c3d_lab, tmp_path):
    ready = prepare_subject(subject_with(tmp_path, c3d_lab, "plate_sd_mm = 2\nclock_sd_ms = 0.5"))
    known = ready.uncertainty.instruments
    assert (known.plate["x"].sd, known.delay_s.sd) == (0.002, 0.0005)
    outcome = run("fit", subject_with(tmp_path, c3d_lab, "plate_sd_mm = -2"), "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "plate_sd_mm = -2" in outcome.err


def test_people_who_contradict_each_other_are_named():
    def person(name, delay_s):
        information = np.diag([1e4] * 8 + [1e8])
        rhs = tuple((information @ [*[0.0] * 8, delay_s]).tolist())
        rows = tuple(map(tuple, information.tolist()))
        return PersonInstruments(name=name, files=(name,), plates=("plate 1",), information=rows, rhs=rhs)

    alike = session_instruments([person("A", 0.010), person("B", 0.0101)], Instruments())
    assert alike.contradictions == ()
    assert alike.found["synchronisation"]["delay"][0] == pytest.approx(0.010, abs=1e-4)
    assert alike.found["synchronisation"]["delay"][1] == pytest.approx(1e-4 / np.sqrt(2.0), rel=0.01)
    (contradiction,) = session_instruments([person("A", 0.010), person("B", 0.002)], Instruments()).contradictions
    assert contradiction.code == "S501"
    found = [contradiction.evidence[name].value for name in ("error", "other_error")]
    assert found == pytest.approx([0.010, 0.002], abs=1e-4)


def test_columns_of_force_files_are_plates_only_where_somebody_says_so(sample_walk, tmp_path):
    walk = sample_walk / "gait2354" / "subject01_walk1"
    text = f"""
[subject]
mass_kg = 72.6
height_m = 1.803
sex = "male"
[model]
static = "{(walk.parent / "subject01_static.trc").as_posix()}"
[[trial]]
markers = "{walk.as_posix()}.trc"
forces = "{walk.as_posix()}_grf.mot"
loads = "{walk.as_posix()}_grf.xml"
"""
    path = tmp_path / "subject.toml"
    path.write_text(text, encoding="utf-8")
    outcome = run("instruments", path, "-o", tmp_path / "instruments.toml")
    assert outcome.status == 2
    assert "same_plates = true under [instruments]" in outcome.err
    path.write_text(f"{text}[instruments]\nsame_plates = true\n", encoding="utf-8")
    check_plates(read_subject(path))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["walk.c3d"], "expected a subject file"),
        (["subject.toml", "-o", "."], "a folder; give the name of a file"),
        (["subject.toml", "-o", "nowhere/x.toml"], "no such folder"),
        (["subject.toml", "-o", "subject.toml"], "not a file that kinertia instruments wrote"),
    ],
)
def test_what_cannot_be_is_refused_first(arguments, words, c3d_lab, monkeypatch):
    monkeypatch.chdir(c3d_lab)
    outcome = run("instruments", *arguments)
    assert outcome.status == 2
    assert words in outcome.err
