"""What users overrule: errors that they waive, warnings that they ignore, trials left out; and what is said of it."""

import json
import re
import shutil
from dataclasses import replace
from types import SimpleNamespace

import pytest

from command_line import run
from kinertia.io.recording import read_recording
from kinertia.io.text.sto import read_sto, write_sto
from kinertia.io.text.trc import write_trc
from report_page import Elements
from spoilt_lab import blocking, blocking_codes

MASS_KG = 90.0
"""Of a person of 72.6 kg: S111 is an error."""
SUBJECT = """[subject]
name = "anna"
sex = "male"
mass_kg = {mass}
height_m = 1.803
[model]
static = "static.trc"
[settings]
method = "two-level"
"""
WALK = '[[trial]]\nmarkers = "walk.trc"\nforces = "walk.mot"\nloads = "walk.xml"\n'


def subject_file(lab, *parts, mass=72.6):
    (lab / "subject.toml").write_text(SUBJECT.format(mass=mass) + "".join(parts), encoding="utf-8")
    return lab / "subject.toml"


def overruling(waive=(), ignore=(), table="[diagnostics]"):
    return f"{table}\nwaive = {list(waive)}\nignore = {list(ignore)}\n"


OF_TRIAL = "[trial.diagnostics]"


def told(*arguments, status):
    outcome = run(*arguments, "--json")
    assert outcome.status == status, outcome.err
    return json.loads(outcome.out)


def statuses(content, code):
    return [finding["status"] for finding in content["findings"] if finding["code"] == code]


def with_reversed_forces(lab):
    """A second trial, of which the fore-aft forces have the wrong sign: P232."""
    table = read_sto(lab / "walk.mot")
    table.loc[:, [name for name in table.columns if name.endswith("_vx")]] *= -1.0
    write_sto(lab / "reversed.mot", table, False, "reversed")
    shutil.copy(lab / "walk.trc", lab / "reversed.trc")
    replaced = WALK.replace("walk.trc", "reversed.trc").replace("walk.mot", "reversed.mot")
    return f'{replaced}name = "reversed"\n'


@pytest.fixture
def waived(lab, few_evaluations):
    """A fit of a person whose stated mass is wrong, which nothing but `--waive` makes."""
    subject = subject_file(lab, WALK, mass=MASS_KG)
    refusal = told("fit", subject, "-o", lab / "out", status=2)
    assert blocking_codes(refusal["findings"]) == ["S111"]
    assert not (lab / "out").exists()
    outcome = run("fit", subject, "-o", lab / "out", "--waive", "s111")
    content = json.loads((lab / "out" / "fit.json").read_text(encoding="utf-8"))
    return SimpleNamespace(folder=lab / "out", outcome=outcome, content=content)


def test_a_waived_error_is_fitted_and_shown_as_waived_everywhere(waived):
    assert waived.outcome.status in (0, 1), waived.outcome.err
    assert statuses(waived.content, "S111") == ["waived"]
    assert "S111" not in [finding["code"] for finding in blocking(waived.content["findings"])]
    assert waived.content["verdict"] != "use"
    first = waived.outcome.out.splitlines()[0]
    assert re.search(r"ne error was waived; the trial was used", first)
    assert "\nERROR [waived]  walk  S111 " in waived.outcome.out
    assert "--waive" not in waived.outcome.out
    page = (waived.folder / "report.html").read_text(encoding="utf-8")
    assert "S111" in Elements(page).text
    assert re.search(r"waived", Elements(page).text)
    assert "--waive S111" in page


def test_check_shows_a_waived_error_as_waived(lab):
    files = [lab / name for name in ("walk.trc", "walk.mot", "static.trc")]
    given = ("check", *files, "--loads", lab / "walk.xml", "--mass", MASS_KG)
    assert blocking_codes(told(*given, status=1)["findings"]) == ["S111"]
    content = told(*given, "--waive", "S111", status=0)
    assert (content["verdict"], statuses(content, "S111")) == (["use with care"], ["waived"])
    for verbose in ([], ["-v"]):
        outcome = run(*given, "--waive", "S111", *verbose, "-o", lab / "out")
        assert re.search(r"^Use with care. One error was waived; the trial was used\.$", outcome.out, re.MULTILINE)
        assert "\nERROR [waived]  walk  S111 " in outcome.out
    text = " ".join(Elements((lab / "out" / "check.html").read_text(encoding="utf-8")).text.split())
    assert "walk use with care S111 Do this next S111 waived walk: " in text


@pytest.mark.parametrize("code", ["S111", "S11"])
def test_a_subject_file_waives_codes_and_questions(lab, code):
    content = told("check", subject_file(lab, overruling([code]), WALK, mass=MASS_KG), status=0)
    assert (content["verdict"], statuses(content, "S111")) == (["use with care"], ["waived"])


def test_a_trial_waives_for_itself_alone(lab):
    table = overruling(["P232"], table=OF_TRIAL)
    both = (with_reversed_forces(lab), WALK)
    assert statuses(told("check", subject_file(lab, *both), status=1), "P232") == ["open"]
    assert statuses(told("check", subject_file(lab, both[0], table, both[1]), status=0), "P232") == ["waived"]
    assert statuses(told("check", subject_file(lab, *both, table), status=1), "P232") == ["open"]


def test_what_is_ignored_does_not_count_and_an_error_cannot_be(lab):
    subject = subject_file(lab, WALK, mass=75.5)
    assert told("check", subject, status=0)["verdict"] == ["use with care"]
    for parts in ((overruling(ignore=["S111"]), WALK), (WALK, overruling(ignore=["S11"], table=OF_TRIAL))):
        content = told("check", subject_file(lab, *parts, mass=75.5), status=0)
        assert (content["verdict"], statuses(content, "S111")) == (["use"], ["ignored"])
    shown = run("check", subject).out
    assert "S111" not in shown
    content = told("check", subject_file(lab, overruling(ignore=["S111"]), WALK, mass=MASS_KG), status=1)
    assert statuses(content, "S111") == ["open"]


@pytest.mark.parametrize(
    ("waive", "ignore", "code"), [(["S199"], [], "S199"), ([], ["Q1"], "Q1"), (["L101"], [], "L101")]
)
@pytest.mark.parametrize("table", ["[diagnostics]", OF_TRIAL])
def test_codes_that_do_not_exist_or_are_hard_are_refused_in_subject_files(lab, waive, ignore, code, table):
    subject = subject_file(lab, WALK, overruling(waive, ignore, table))
    line = next(k for k, text in enumerate(subject.read_text().splitlines(), 1) if code in text)
    for command in ("check", "fit"):
        (found,) = told(command, subject, status=2)["findings"]
        assert found["code"] == "F191"
        assert found["where"] == {"file": "subject.toml", "line": line}
        assert code in found["message"]


@pytest.mark.parametrize(("code", "words"), [("S199", "is not the code of a finding"), ("L101", "cannot be waived")])
@pytest.mark.parametrize("command", ["check", "fit"])
def test_codes_that_do_not_exist_or_are_hard_are_refused_as_options(lab, command, code, words):
    outcome = run(command, subject_file(lab, WALK), "--waive", code)
    assert (outcome.status, outcome.out) == (2, "")
    assert f"{code} {words}" in " ".join(outcome.err.replace("│", " ").split())


@pytest.mark.parametrize(
    ("code", "mass", "words"),
    [("P244", 72.6, "it was not found"), ("S111", 75.5, "S111 is no ERROR here"), ("R305", 72.6, None)],
)
def test_check_reports_what_was_waived_in_vain(lab, code, mass, words):
    notes = [
        line
        for line in run("check", subject_file(lab, WALK, mass=mass), "--waive", code).out.splitlines()
        if line.startswith("note: ")
    ]
    assert notes == ([] if words is None else [f"note: --waive {code} has no effect: {words}"])


def test_a_hard_error_waived_by_its_question_is_reported(lab):
    alone = '[[trial]]\nmarkers = "walk.trc"\n'
    outcome = run("check", subject_file(lab, alone), "--waive", "P27")
    assert "\nnote: --waive P27 has no effect: P271 is an ERROR that cannot be waived\n" in outcome.out


def test_a_hard_error_stays_open_where_its_question_is_waived(lab):
    alone = '[[trial]]\nmarkers = "walk.trc"\n'
    content = told("check", subject_file(lab, overruling(["P27"]), alone), status=1)
    assert blocking_codes(content["findings"]) == ["P271"]


@pytest.mark.parametrize("command", ["check", "fit"])
def test_a_waiver_of_what_a_reader_refuses_is_reported(lab, command):
    """Z up in the markers, Y up in the forces."""
    markers = read_recording(lab / "walk.trc").markers
    write_trc(lab / "walk.trc", replace(markers, positions=markers.positions[..., [0, 2, 1]] * [1.0, -1.0, 1.0]))
    outcome = run(command, subject_file(lab, WALK), "--waive", "P201")
    assert outcome.status == 2
    assert outcome.out == "note: --waive P201 has no effect: P201 is an ERROR that cannot be waived\n"


@pytest.mark.usefixtures("few_evaluations")
def test_a_fit_reports_what_was_waived_in_vain(lab):
    outcome = run("fit", subject_file(lab, WALK), "-o", lab / "out", "--waive", "P244", "--waive", "R3")
    notes = [line for line in outcome.out.splitlines() if line.startswith("note: --waive P244")]
    assert notes == ["note: --waive P244 has no effect: it was not found"]


@pytest.mark.usefixtures("few_evaluations")
def test_a_blocked_trial_is_left_out_and_the_other_fitted(lab):
    subject = subject_file(lab, with_reversed_forces(lab), WALK)
    outcome = run("fit", subject, "-o", lab / "out")
    assert outcome.status == 1, outcome.err
    assert re.search(r"1 of 2 trials was used", outcome.out.splitlines()[0])
    content = json.loads((lab / "out" / "fit.json").read_text(encoding="utf-8"))
    assert content["trials_left_out"] == ["reversed"]
    assert [trial["name"] for trial in content["trials"]] == ["walk"]
    (found,) = [finding for finding in content["findings"] if finding["code"] == "P232"]
    assert (found["where"]["trial"], found["severity"], found["status"]) == ("reversed", "ERROR", "open")
    assert "reversed" in Elements((lab / "out" / "report.html").read_text(encoding="utf-8")).text


def test_a_blocked_trial_is_left_out_by_check(lab):
    outcome = run("check", subject_file(lab, with_reversed_forces(lab), WALK))
    assert outcome.status == 1
    verdict = r"^Use with care. One error; 1 of 2 trials was used, and the markers of one more."
    assert re.search(verdict + r"\nERROR  reversed  P232 ", outcome.out)


def test_where_all_trials_are_blocked_every_error_is_a_line_and_json_has_them(lab):
    both = with_reversed_forces(lab)
    two = both + both.replace('"reversed"', '"again"')
    outcome = run("fit", subject_file(lab, two), "-o", lab / "out", "--json")
    assert outcome.status == 2
    content = json.loads(outcome.out)
    assert [finding["where"]["trial"] for finding in blocking(content["findings"])] == ["reversed", "again"]
    errors = [line for line in outcome.err.splitlines() if line.startswith("error: ")]
    assert [line.split("  ")[0] for line in errors] == ["error: reversed", "error: again"]
    assert content["error"].count("P232") == 2
    assert not (lab / "out").exists()


def test_check_and_fit_are_json_where_they_refuse_without_a_finding(lab):
    (lab / "notes.xlsx").write_text("")
    for given in (("check", lab / "notes.xlsx"), ("fit", subject_file(lab, WALK), "--mass", "70")):
        content = told(*given, status=2)
        assert content["error"]
        assert isinstance(content["findings"], list)
