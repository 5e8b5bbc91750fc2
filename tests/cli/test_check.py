"""`kinertia check` as a user runs it."""

import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

from command_line import run
from kinertia.io.trc import write_trc
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.walk import walk, walking_subject
from spoilt_lab import blocking, blocking_codes


@pytest.fixture(scope="module")
def recordings():
    subject = walking_subject()
    trial = walk(subject, 2.7, 1000.0, 0.75)
    return record(subject, trial, LabNoise(skin="none"), np.random.default_rng(3), 10)


@pytest.fixture
def lab(tmp_path, recordings):
    """A folder with subject.toml, static.trc, walk.trc, walk_grf.mot of a synthetic person."""
    write_lab(tmp_path / "lab", recordings)
    return tmp_path / "lab"


def text(outcome):
    return " ".join(outcome.out.split())


def told(*arguments, status=0):
    """What the command gives to scripts."""
    outcome = run("check", *arguments, "--json")
    assert outcome.status == status or status is None, outcome.err
    return json.loads(outcome.out)


def facts_of(content):
    return {one["name"]: one["facts"] for one in content["recordings"]}


def test_subject_file(lab):
    content = told(lab / "subject.toml")
    assert (content["verdict"], blocking(content["findings"])) == (["use"], [])
    assert content["rules_run"] > 100
    facts = facts_of(content)
    assert facts["static"]["files"] == "static.trc"
    assert facts["walk"]["files"] == "walk.trc, walk_grf.mot"
    assert "walks along +X" in facts["walk"]["the person"]
    assert re.fullmatch(r"[\d.]+ to [\d.]+ s", facts["walk"]["complete contact"])


def test_a_drafted_subject_file_needs_no_sex(lab):
    """Which only a fit needs, and asks for."""
    path = lab / "subject.toml"
    path.write_text(re.sub(r"(?m)^sex = .*\n", "", path.read_text()))
    assert run("check", path).status == 0
    assert told(path)["fit_also_needs"] == ["sex"]
    assert "F191" in run("fit", path, "-o", lab / "out").err


def test_the_verdict_is_one_line_and_verbose_says_all(lab):
    outcome = run("check", lab / "subject.toml")
    assert outcome.status == 0
    assert re.match(r"use: nothing found; \d+ rules, 1 of 1 trials\n", outcome.out)
    assert outcome.err.splitlines() == ["reading"]
    loud = run("check", lab / "subject.toml", "-v")
    findings = told(lab / "subject.toml")["findings"]
    assert findings
    for one in findings:
        assert f"{one['severity']}  " in loud.out
        assert f"{one['code']} {one['message']}" in loud.out
    before = loud.out.partition("\nuse: ")[0].splitlines()
    assert max(map(len, before)) <= 80
    for facts in facts_of(told(lab / "subject.toml")).values():
        for name, sentence in facts.items():
            assert f"{name} {sentence}" in text(loud)


def test_widths_of_joints_may_come_from_elsewhere(tmp_path, recording_of, c3d_lab):
    """Plug-in Gait has no medial markers; TRC files have no widths, the walk's C3D and the subject file may."""
    static = recording_of("synthetic/static.c3d").markers
    write_trc(tmp_path / "static.trc", static)
    subject = "[subject]\nsex = 'male'\nmass_kg = 72.6\nheight_m = 1.803\nWIDTHS\n[model]\nstatic = 'static.trc'\n"
    subject += "[[trial]]\nmarkers = 'walk.c3d'\n"
    shutil.copy(c3d_lab / "walk.c3d", tmp_path / "walk.c3d")
    (tmp_path / "subject.toml").write_text(subject.replace("WIDTHS", ""))
    assert blocking(told(tmp_path)["findings"]) == []
    walk = recording_of("synthetic/walk.c3d").markers
    write_trc(tmp_path / "walk.trc", walk)
    (tmp_path / "subject.toml").write_text(subject.replace("WIDTHS", "").replace("c3d", "trc"))
    lacking = [one for one in blocking(told(tmp_path, status=1)["findings"]) if one["code"] == "L105"]
    assert "knee_r" in {one["where"]["part"] for one in lacking}
    stated = "\n".join(f"{joint}_width_mm = 80.0" for joint in ("knee", "ankle", "elbow"))
    (tmp_path / "subject.toml").write_text(subject.replace("WIDTHS", stated).replace("c3d", "trc"))
    assert "L105" not in blocking_codes(told(tmp_path, status=None)["findings"])


def test_a_folder_with_a_subject_file_stands_for_it(lab):
    assert run("check", lab).out == run("check", lab / "subject.toml").out


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


def test_another_mass_is_status_1(lab):
    files = (lab / "walk.trc", lab / "walk_grf.mot", "--mass", "90")
    content = told(*files, status=1)
    (found,) = blocking(content["findings"])
    assert (found["code"], content["verdict"]) == ("S111", ["do not use"])
    assert found["evidence"]["stated_kg"]["value"] == 90.0
    assert found["evidence"]["mass_by_force_kg"]["value"] == pytest.approx(72.6, abs=0.5)
    outcome = run("check", *files)
    assert re.match(r"do not use: 1 error; \d+ rules, 0 of 1 trials\nERROR  walk  S111 ", outcome.out)


def test_labels_of_another_marker_set_are_one_error(lab):
    (found,) = blocking(told(lab / "walk.trc", lab / "walk_grf.mot", "--markers", "plug-in-gait", status=1)["findings"])
    assert found["code"] == "L101"
    assert [found["evidence"][name]["value"] for name in ("labels_found", "labels")] == [0, 33]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no.trc"], "no.trc: F101 "),
        (["walk_grf.mot"], "holds forces only"),
        (["walk.trc", "static.trc", "walk_grf.mot", "more_grf.mot"], "goes with none of the marker files"),
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
    assert "1 of 2 trials\nERROR  broken  F103 " in outcome.out
    page = text_of_page(lab / "out" / "check.html")
    for phrase in ("F103", "The content of broken.c3d", "static", "walk"):
        assert phrase in page


def test_gaps_are_listed_when_asked(lab, recordings):
    markers = recordings.walk.markers
    positions = markers.positions.copy()
    positions[:20, markers.labels.index("R.Heel")] = np.nan
    write_trc(lab / "walk.trc", type(markers)(markers.time, markers.labels, positions))
    outcome = run("check", lab / "walk.trc", lab / "walk_grf.mot", "--verbose")
    assert re.search(r"R\.Heel +\d+ +0\.20", outcome.out)
    assert not re.search(r"L\.Heel +100", outcome.out)


def test_quiet_says_it_by_the_status(lab):
    fine = run("check", lab / "walk.trc", lab / "walk_grf.mot", "--quiet")
    assert (fine.status, fine.out, fine.err) == (0, "", "")
    against = run("check", lab / "walk.trc", lab / "walk_grf.mot", "--mass", "90", "-q")
    assert (against.status, against.out, against.err) == (1, "", "")
    mistake = run("check", lab / "no.trc", "-q")
    assert mistake.status == 2
    assert mistake.err.startswith("error: ")
    assert run("check", lab / "walk.trc").out  # the next command speaks again


class Page(HTMLParser):
    """What a page refers to, and its text."""

    def __init__(self, content):
        super().__init__()
        self.tags, self.references, self.words = [], [], []
        self.feed(content)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.references += [value for name, value in attrs if name in ("src", "href", "srcset", "data")]

    def handle_data(self, data):
        self.words.append(data)


def text_of_page(path):
    return " ".join(" ".join(Page(path.read_text(encoding="utf-8")).words).split())


def test_page_is_one_file_that_needs_nothing_else(lab):
    shutil.move(lab / "walk.trc", lab / "<script>alert(1)</script>.trc".replace("/", ""))
    (spoilt,) = lab.glob("<script>*")
    outcome = run("check", spoilt, lab / "walk_grf.mot", "-o", lab / "out", "--mass", 72.6)
    assert outcome.status == 0
    (written,) = (lab / "out").glob("[!.]*")
    assert written.stat().st_size < 3_000_000
    page = Page(written.read_text(encoding="utf-8"))
    assert [one for one in page.references if not one.startswith("#")] == []
    assert "<script>alert" not in written.read_text(encoding="utf-8")
    words = " ".join(" ".join(page.words).split())
    assert "<script>alert(1)<script>" in words
    for phrase in ("walks along +X", "R.Heel", "foot on plate", "2 plates at 1000 Hz"):
        assert phrase in words


def test_page_goes_only_where_it_may(lab):
    (lab / "foreign").mkdir()
    (lab / "foreign" / "thesis.tex").write_text("mine")
    refused = run("check", lab / "static.trc", "-o", lab / "foreign")
    assert refused.status == 2
    assert "--overwrite" in refused.err
    assert [path.name for path in (lab / "foreign").iterdir()] == ["thesis.tex"]
    assert run("check", lab / "static.trc", "-o", lab / "foreign", "--overwrite").status == 0
    assert (lab / "foreign" / "thesis.tex").read_text() == "mine"
    (lab / "foreign" / "thesis.tex").unlink()
    assert run("check", lab / "static.trc", "-o", lab / "foreign").status == 0  # its own is replaced


@pytest.mark.slow
def test_files_of_two_people_keep_their_masses(measured_folder):
    """The walk of A carries no mass, the others do: it is A's static trial's, until files of B come first."""
    a, b = ([measured_folder / "pig_c3d" / f"subject_{who}_{kind}.c3d" for kind in ("static", "walk")] for who in "ab")
    (alone,) = [one for one in told(*a)["findings"] if one["code"] == "S111"]
    assert alone["evidence"]["stated_kg"]["value"] == pytest.approx(41.5, abs=0.1)
    together = told(*a, *b, status=1)["findings"]
    (stated,) = [one for one in together if (one["code"], one["where"].get("part")) == ("S103", "mass")]
    assert [round(stated["evidence"][name]["value"], 1) for name in ("stated", "filed")] == [47.5, 41.5]
    assert blocking_codes(together) == ["S111"]


def test_model(measured_folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = measured_folder / "rajagopal_walk" / "scaled.osim"
    person = ["--mass", "85", "--height", "1.83", "--sex", "male"]
    content = told(model, *person)
    assert "O215" in [one["code"] for one in content["findings"] if one["severity"] == "WARNING"]
    outcome = run("check", model, *person, "-o", "out", "-v")
    assert outcome.status == 0
    assert re.search(r"pelvis +model +13\.30", outcome.out)
    assert re.search(r"de Leva +9\.49", outcome.out)
    assert max(map(len, outcome.out.partition("\nuse with care: ")[0].splitlines())) <= 80
    page = text_of_page(tmp_path / "out" / "check.html")
    assert "Segments, in ISB axes" in page
    assert "13.30" in page
    assert run("check", model, "--height", "183", "--sex", "male").status == 2
    assert [one["code"] for one in told(model)["findings"] if one["code"].startswith("O4")] == ["O415"]


def test_impossible_model_is_status_1(synthetic_lab, tmp_path):
    content = (synthetic_lab / "scaled.osim").read_text()
    broken, count = re.subn(
        r'(<Body name="shank_l">.*?<inertia>)[^<]*', r"\g<1>0.9 0.0076 0.076 0 0 0", content, count=1, flags=re.DOTALL
    )
    assert count == 1
    (tmp_path / "broken.osim").write_text(broken)
    (found,) = blocking(told(tmp_path / "broken.osim", status=1)["findings"])
    assert (found["code"], found["where"]["part"]) == ("O201", "shank_l")
    assert "iyy + izz > ixx" in found["message"]


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
            assert outcome.out.startswith("do not use: ") == (outcome.status == 1)
    assert seen == {0, 1, 2}


def test_subject_file_with_a_model(synthetic_lab, tmp_path):
    """The markers are the model's: as for `kinertia fit`, no preset is asked for."""
    data = synthetic_lab
    (tmp_path / "subject.toml").write_text(
        f'[subject]\nname = "four"\nmass_kg = 72.6\n[model]\nosim = "{data / "scaled.osim"}"\n'
        f'[[trial]]\nmarkers = "{data / "walk.trc"}"\nforces = "{data / "walk_grf.mot"}"\n'
        f'loads = "{data / "walk_grf.xml"}"\n'
    )
    content = told(tmp_path / "subject.toml")
    facts = facts_of(content)["walk"]
    assert re.search(r"scaled\.osim: \d+ of its \d+ labels", facts["marker set"])
    assert re.fullmatch(r"[\d.]+ to [\d.]+ s", facts["complete contact"])
    assert {"L101", "P278"}.isdisjoint(one["code"] for one in content["findings"])


def test_a_model_and_forces_are_given_as_to_a_fit(synthetic_lab, tmp_path):
    data = synthetic_lab
    walk = (data / "walk.trc", "--forces", data / "walk_grf.mot", "--loads", data / "walk_grf.xml")
    content = told(*walk, "--model", data / "scaled.osim", "--mass", 72.6)
    assert facts_of(content)["walk"]["files"] == "walk.trc, walk_grf.mot"
    assert "scaled.osim" in facts_of(content)["walk"]["marker set"]
    for more in (("--model", data / "scaled.osim", "--markers", "plug-in-gait"), ("--calibrate",)):
        outcome = run("check", *walk, *more)
        assert outcome.status == 2
        assert "F193 " in outcome.err


def test_model_that_is_doubted_in_a_subject_file(measured_folder, tmp_path):
    """What the fit will warn of; a sound model is not mentioned."""
    data = measured_folder / "subject4"
    sound = (data / "addbiomechanics_scaled.osim").read_text()
    (joint,) = re.findall(r'<CustomJoint name="walker_knee_l">.*?</CustomJoint>', sound, flags=re.DOTALL)
    moved, count = re.subn(r"(<translation>)(\S+)", lambda found: f"{found[1]}{float(found[2]) + 0.03}", joint, count=1)
    assert count == 1
    for name, content in (("sound", sound), ("moved", sound.replace(joint, moved))):
        (tmp_path / f"{name}.osim").write_text(content)
        (tmp_path / f"{name}.toml").write_text(
            f'[subject]\nname = "four"\nmass_kg = 60.0\n[model]\nosim = "{name}.osim"\n'
            f'[[trial]]\nmarkers = "{data / "walking1.trc"}"\nforces = "{data / "walking1_grf.mot"}"\n'
            f'loads = "{data / "walking1_external_forces.xml"}"\n'
        )
    found = {
        name: [one for one in told(tmp_path / f"{name}.toml")["findings"] if one["code"] == "O303"]
        for name in ("sound", "moved")
    }
    assert found["sound"] == []
    (moved,) = found["moved"]
    assert moved["evidence"]["distance_m"]["value"] == pytest.approx(0.03, abs=0.001)
    run("check", tmp_path / "moved.toml", "-o", tmp_path / "out")
    assert moved["message"] in text_of_page(tmp_path / "out" / "check.html")


def test_model_of_other_markers_in_a_subject_file(lab, synthetic_lab):
    """None shared fails; none in the model is an error, as it is to a fit."""
    model = synthetic_lab / "scaled.osim"
    body = f'[[trial]]\nmarkers = "{lab / "other.trc"}"\nforces = "{lab / "walk_grf.mot"}"\n'
    (lab / "s.toml").write_text(f'[subject]\nname = "s"\nmass_kg = 72.6\n[model]\nosim = "{model}"\n{body}')
    labels = (lab / "walk.trc").read_text().splitlines(keepends=True)
    head = labels[3].split("\t")
    labels[3] = "\t".join([*head[:2], *(f"x{name}" if name.strip() else name for name in head[2:])])
    (lab / "other.trc").write_text("".join(labels))
    (found,) = blocking(told(lab / "s.toml", status=1)["findings"])
    assert (found["code"], found["evidence"]["name"]["value"]) == ("L101", "scaled.osim")
    assert found["evidence"]["labels_found"]["value"] == 0
    bare, count = re.subn(r"<MarkerSet.*?</MarkerSet>", "", model.read_text(), flags=re.DOTALL)
    assert count == 1
    (lab / "bare.osim").write_text(bare)
    (lab / "s.toml").write_text((lab / "s.toml").read_text().replace(str(model), str(lab / "bare.osim")))
    outcome = run("check", lab / "s.toml")
    assert outcome.status == 2
    assert "bare.osim: O106 " in outcome.err


@pytest.mark.parametrize(("mass", "status"), [("72.6", 0), ("90", 1)])
@pytest.mark.slow
def test_nobody_reads_on(lab, mass, status):
    """As with `| head`: the page is there, and the status is the check's."""
    files = [str(lab / name) for name in ("walk.trc", "walk_grf.mot")]
    command = [sys.executable, "-c", "from kinertia.cli.app import main; main()", "check", *files, "--mass", mass]
    read, write = os.pipe()
    os.close(read)
    try:
        ended = subprocess.run([*command, "-o", str(lab / "out")], stdout=write, stderr=subprocess.PIPE, text=True)
    finally:
        os.close(write)
    assert (ended.returncode, ended.stderr) == (status, "reading\n")
    assert "complete contact" in (lab / "out" / "check.html").read_text()
