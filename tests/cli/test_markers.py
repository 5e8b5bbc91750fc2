"""`kinertia markers`: which preset a file has, and what a draft lacks."""

import json

from command_line import run
from generic_static import recording, standing_positions
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.text.trc import write_trc


def written(path, positions):
    write_trc(path, recording(positions, frames=30).markers)
    return path


def test_a_preset_whose_landmarks_a_static_trial_lacks_is_said_to_lack_them(tmp_path):
    names = {"R.Knee.Med": "R.Innen", "L.Knee.Med": "L.Innen"}
    positions = {names.get(label, label): at for label, at in standing_positions().items()}
    shown = run("markers", written(tmp_path / "static.trc", positions)).out
    assert "cleveland-clinic is recognised by itself" in shown
    assert "but this static trial lacks some of its landmarks" in shown
    complete = run("markers", written(tmp_path / "complete.trc", standing_positions())).out
    assert "lacks landmarks" not in complete


def test_a_draft_is_a_marker_set_and_says_what_it_lacks(tmp_path):
    positions = {label: at for label, at in standing_positions().items() if label != "R.Heel"}
    file, own = written(tmp_path / "static.trc", positions), tmp_path / "own.toml"
    outcome = run("markers", file, "-o", own)
    assert "not found, and needed: heel_r" in outcome.out
    assert read_marker_set(own).landmarks["heel_l"] == ("L.Heel",)
    assert run("markers", file, "-o", own).status == 2, "what is there is left alone"
    content = json.loads(run("markers", file, "-o", tmp_path / "other.toml", "--json").out)
    assert (content["needed"], content["notes"]) == (["heel_r"], [])
