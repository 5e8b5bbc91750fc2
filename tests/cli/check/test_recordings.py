"""`kinertia check` of recordings, given as files."""

import re
import shutil

import pytest

from checked import facts_of, text_of_page, told
from command_line import run
from spoilt_lab import blocking, blocking_codes


def test_files_find_each_other_by_name(lab):
    content = told(lab / "static.trc", lab / "walk_grf.mot", lab / "walk.trc", "--mass", 72.6)
    assert facts_of(content)["walk"]["files"] == "walk.trc, walk_grf.mot"


def test_markers_alone_lack_forces_and_nothing_else(lab):
    assert blocking_codes(told(lab / "walk.trc", "--mass", 72.6, status=1)["findings"]) == ["P271"]


def test_forces_of_the_walk_never_go_to_the_static_trial(lab):
    """Though the names are as like: Rajagopal's files are called so."""
    static = (lab / "static.trc").rename(lab / "static_walk_1.trc")
    walked = (lab / "walk.trc").rename(lab / "motion_capture_walk.trc")
    forces = (lab / "walk_grf.mot").rename(lab / "grf_walk.mot")
    facts = facts_of(told(static, walked, forces))
    assert facts["motion_capture_walk"]["files"] == "motion_capture_walk.trc, grf_walk.mot"
    assert facts["static_walk_1"]["forces"] == "none"
    # two files can only go together
    assert "grf_walk.mot" in facts_of(told(static, forces))["static_walk_1"]["files"]


def test_recordings_of_one_name_are_told_apart(lab):
    (lab / "more").mkdir()
    shutil.copy(lab / "walk.trc", lab / "more" / "walk.trc")
    names = [str(lab / "walk.trc"), str(lab / "more" / "walk.trc")]
    assert list(facts_of(told(*names, status=1))) == names


@pytest.mark.slow
def test_files_of_two_people_keep_their_masses(measured_folder):
    """Each file carries its person's mass: the first walk's is used, and that of the other person reported."""
    a, b = ([measured_folder / "pig_c3d" / f"subject_{who}_{kind}.c3d" for kind in ("static", "walk")] for who in "ab")
    (alone,) = [finding for finding in told(*a)["findings"] if finding["code"] == "S111"]
    assert alone["evidence"]["stated_kg"]["value"] == pytest.approx(41.5, abs=0.1)
    for files, masses in (((*a, *b), [41.5, 47.5]), ((*b, *a), [47.5, 41.5])):
        together = told(*files, status=1)["findings"]
        (stated,) = [
            finding for finding in together if (finding["code"], finding["where"].get("part")) == ("S103", "mass")
        ]
        assert [round(stated["evidence"][name]["value"], 1) for name in ("stated", "filed")] == masses
        # each walk is of another person than one of the static trials
        accused = {finding["where"]["trial"] for finding in blocking(together) if finding["code"] == "S203"}
        assert accused == {"subject_a_static", "subject_b_static"}


def test_another_mass_is_status_1(lab):
    files = (lab / "walk.trc", lab / "walk_grf.mot", "--mass", "90")
    content = told(*files, status=1)
    (found,) = blocking(content["findings"])
    assert (found["code"], content["verdict"]) == ("S111", ["do not use"])
    assert found["evidence"]["stated_kg"]["value"] == 90.0
    assert found["evidence"]["mass_by_force_kg"]["value"] == pytest.approx(72.6, abs=0.5)
    outcome = run("check", *files)
    assert re.match(r"Do not use\. One error; 0 of 1 trials were used\.\nERROR  walk  S111 ", outcome.out)


def test_labels_of_another_marker_set_are_one_error(lab):
    (found,) = blocking(told(lab / "walk.trc", lab / "walk_grf.mot", "--markers", "plug-in-gait", status=1)["findings"])
    assert found["code"] == "L101"
    assert [found["evidence"][name]["value"] for name in ("labels_found", "labels")] == [0, 33]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no.trc"], "no.trc: F101 "),
        (["walk_grf.mot"], "holds forces only"),
        (["walk.trc", "static.trc", "walk_grf.mot", "more_grf.mot"], "matches none of the marker files by name"),
        (["walk.trc", "--mass", "-5"], "mass_kg = -5"),
        (["walk.trc", "--mass", "0"], "mass_kg = 0"),
        (["walk.xlsx"], "a '.xlsx' file cannot be checked"),
        (["loads.xml"], "give ExternalLoads with --loads"),
        (["subject.toml", "walk.trc"], "give it alone"),
        (["subject.toml", "--mass", "70"], "give it alone"),
        (["subject.toml", "--sex", "male"], "give it alone"),
        ([".."], "is a folder"),
        (["walk.trc", "static.trc", "--loads", "loads.xml"], "but 2 are given"),
        (["scaled.osim", "--loads", "loads.xml"], "but 0 are given"),
        (["walk.trc", "--markers", "nobodys"], "nobodys: F101 "),
        (["model.osim"], "model.osim, line 1: O101 "),
        (["empty.c3d"], "empty.c3d: F104 "),
        (["no.osim"], "no.osim: F101 "),
        (["walk.trc", "--height", "170"], "S102 "),
    ],
)
def test_errors_are_one_line_and_status_2(lab, synthetic_lab, monkeypatch, arguments, words):
    monkeypatch.chdir(lab)
    shutil.copy(synthetic_lab / "scaled.osim", lab)
    (lab / "loads.xml").write_text("<x/>")
    (lab / "model.osim").write_text("not a model")
    (lab / "empty.c3d").write_bytes(b"")
    outcome = run("check", *arguments)
    assert outcome.status == 2
    assert words in outcome.err
    assert [line for line in outcome.err.splitlines() if line != "reading"] == [outcome.err.splitlines()[-1]]


def test_a_broken_file_does_not_hide_the_others(lab):
    (lab / "broken.c3d").write_bytes(b"x" * 600)
    files = [lab / name for name in ("broken.c3d", "static.trc", "walk.trc", "walk_grf.mot")]
    content = told(*files, status=1)
    (found,) = blocking(content["findings"])
    assert (found["code"], found["where"]) == ("F103", {"file": "broken.c3d", "trial": "broken"})
    assert list(facts_of(content)) == ["static", "walk"]
    outcome = run("check", *files, "-o", lab / "out")
    assert outcome.status == 1
    assert "1 of 2 trials was used.\nERROR  broken  F103 " in outcome.out
    page = text_of_page(lab / "out" / "check.html")
    for phrase in ("F103", "The content of broken.c3d", "static", "walk"):
        assert phrase in page


@pytest.mark.slow
def test_every_measured_file_gets_an_answer(measured_folder):
    """No traceback on anything: each file is shown (0), warned of (1) or refused in one line (2)."""
    files = sorted(path for kind in ("trc", "c3d", "osim") for path in measured_folder.rglob(f"*.{kind}"))
    assert len(files) > 20
    seen = set()
    for path in files:
        outcome = run("check", path)
        seen.add(outcome.status)
        assert outcome.status in (0, 1, 2), path
        if outcome.status == 2:
            assert outcome.err.splitlines()[-1].startswith(f"error: {path}")
        else:
            assert outcome.out.startswith("Do not use. ") == (outcome.status == 1)
    assert seen == {0, 1, 2}
