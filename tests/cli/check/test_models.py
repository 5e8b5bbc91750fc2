"""`kinertia check` of OpenSim models, alone and with recordings."""

import re

import pytest

from checked import facts_of, text_of_page, told
from command_line import run
from spoilt_lab import blocking


def test_model(measured_folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = measured_folder / "rajagopal_walk" / "scaled.osim"
    person = ["--mass", "85", "--height", "1.83", "--sex", "male"]
    content = told(model, *person)
    assert "O215" in [finding["code"] for finding in content["findings"] if finding["severity"] == "WARNING"]
    outcome = run("check", model, *person, "-o", "out", "-v")
    assert outcome.status == 0
    assert re.search(r"pelvis +model +13\.30", outcome.out)
    assert re.search(r"de Leva +9\.49", outcome.out)
    assert max(map(len, outcome.out.partition("\nUse with care. ")[0].splitlines())) <= 80
    page = text_of_page(tmp_path / "out" / "check.html")
    assert "Segments, in ISB axes" in page
    assert "13.30" in page
    assert run("check", model, "--height", "183", "--sex", "male").status == 2
    assert [finding["code"] for finding in told(model)["findings"] if finding["code"].startswith("O4")] == ["O415"]


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
    assert {"L101", "P278"}.isdisjoint(finding["code"] for finding in content["findings"])


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
        name: [finding for finding in told(tmp_path / f"{name}.toml")["findings"] if finding["code"] == "O303"]
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
