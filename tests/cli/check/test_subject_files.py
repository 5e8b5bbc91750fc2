"""`kinertia check` of a subject file."""

import re
import shutil

from checked import facts_of, told
from command_line import run
from kinertia.io.text.trc import write_trc
from spoilt_lab import blocking, blocking_codes


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


def test_a_folder_with_a_subject_file_stands_for_it(lab):
    assert run("check", lab).out == run("check", lab / "subject.toml").out


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
    lacking = [finding for finding in blocking(told(tmp_path, status=1)["findings"]) if finding["code"] == "L105"]
    assert "knee_r" in {finding["where"]["part"] for finding in lacking}
    stated = "\n".join(f"{joint}_width_mm = 80.0" for joint in ("knee", "ankle", "elbow"))
    (tmp_path / "subject.toml").write_text(subject.replace("WIDTHS", stated).replace("c3d", "trc"))
    assert "L105" not in blocking_codes(told(tmp_path, status=None)["findings"])
