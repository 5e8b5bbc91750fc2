"""Drafts of subject files: what `kinertia init` finds in a folder, and what it says of the rest."""

import re
import shutil
import tomllib
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from generic_static import recording, standing_positions
from kinertia.errors import FileError
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.subject.body_files import measures_sheet
from kinertia.io.subject.draft import NOT_USED, init_files, init_subject
from kinertia.io.subject.reader import read_subject
from kinertia.io.text.trc import write_trc
from kinertia.settings import Settings
from recordings import here
from refusals import refused

TRIALS = ("DJ1", "squats1", "walking1", "walking2", "walkingTI1", "walkingTO1", "walkingTS1")
LABORATORIES = {
    "gait2354": (
        "subject01_static.trc",
        [("subject01_walk1.trc", "subject01_walk1_grf.mot", "subject01_walk1_grf.xml")],
    ),
    "rajagopal_walk": ("static_walk_1.trc", [("motion_capture_walk.trc", "grf_walk.mot", "grf_walk.xml")]),
    "subject4": ("static1.trc", [(f"{t}.trc", f"{t}_grf.mot", f"{t}_external_forces.xml") for t in TRIALS]),
}
"""By folder: the static trial; markers, forces and loads of the others."""


def completed(text):
    """A draft as a user would complete it: nothing but the sex."""
    return text.replace("# sex", "sex", 1)


def draft(folder, text):
    (folder / "subject.toml").write_text(text, encoding="utf-8")
    return read_subject(folder / "subject.toml")


@pytest.mark.parametrize("name", ["gait2354", *here(["rajagopal_walk", "subject4"])])
def test_init_matches_the_files_of_a_laboratory(name, tmp_path, sample_walk, file_of):
    static, trials = LABORATORIES[name]
    folder = sample_walk / name if name == "gait2354" else file_of(name)
    text = init_subject(folder)
    for file in folder.iterdir():
        (tmp_path / file.name).touch()
    with refused("F191", key="sex"):
        draft(tmp_path, text)
    result = draft(tmp_path, completed(text))
    assert result.model.static.name == static
    assert [(t.markers.name, t.forces.name, t.loads.name) for t in result.trials] == trials
    assert result.settings == Settings()
    assert "# mass_kg = 70.0  # FILL IN" in text
    assert "Left out" not in text


def test_init_takes_the_first_of_two_subjects_and_says_so(tmp_path, c3d_lab):
    for subject, kind in product("ab", ("static", "walk")):
        shutil.copyfile(c3d_lab / f"{kind}.c3d", tmp_path / f"subject_{subject}_{kind}.c3d")
    text = init_subject(tmp_path)
    result = draft(tmp_path, completed(text))
    assert result.model.static.name == "subject_a_static.c3d"
    assert [trial.markers.name for trial in result.trials] == ["subject_a_walk.c3d"]
    assert (result.subject.mass_kg, result.subject.height_m) == pytest.approx((72.6, 1.803))
    left_out = next(line for line in text.splitlines() if line.startswith("# Left out"))
    assert "subject_b_static.c3d, subject_b_walk.c3d" in left_out


def trc(path, frames):
    rows = [f"{k + 1}\t{k / 100:.2f}\t1\t2\t3" for k in range(frames)]
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"100\t100\t{frames}\t1\tmm\t100\t1\t{frames}",
        "Frame#\tTime\tA\t\t",
        "\t\tX1\tY1\tZ1",
        "",
    ]
    path.write_text("\n".join(head + rows) + "\n")


def test_init_takes_the_shortest_where_no_name_says_static(tmp_path):
    for name, frames in (("a.trc", 30), ("b.trc", 9), ("calf_raise.trc", 20)):
        trc(tmp_path / name, frames)
    text = init_subject(tmp_path)
    assert 'static = "b.trc"' in text
    assert "shortest" in text
    result = draft(tmp_path, completed(text))
    assert [trial.markers.name for trial in result.trials] == ["a.trc", "calf_raise.trc"]
    assert text.count("# forces = ") == 2


def test_init_matches_one_force_file_to_each_trial(tmp_path):
    for name in ("cal_01.trc", "walk_1.trc", "walk_2.trc", "run_12.trc"):
        (tmp_path / name).touch()
    for name in ("walk_2_forces.mot", "walk_1_forces.mot", "cal_01_forces.mot"):
        (tmp_path / name).write_text("x\nendheader\ntime\tground_force_vx\tground_force_vy\n")
    (tmp_path / "run_12_ik.mot").write_text("x\nendheader\ntime\tpelvis_tilt\n")
    result = draft(tmp_path, completed(init_subject(tmp_path)))
    forces = {trial.name: trial.forces and trial.forces.name for trial in result.trials}
    assert forces == {"walk_1": "walk_1_forces.mot", "walk_2": "walk_2_forces.mot", "run_12": None}


@pytest.mark.parametrize(
    ("trial", "forces", "other"),
    [
        ("DJ1", "DJ1_forces", "DJ12_forces"),
        ("T1", "T1", "T10"),
        ("W2", "grf_W2", "grf_W22"),
        ("w-3", "W-3 GRF", "W-31 GRF"),
    ],
)
def test_init_matches_short_names_that_are_whole_words_of_the_force_files(tmp_path, trial, forces, other):
    for name in ("static.trc", f"{trial}.trc", "walk_1.trc"):
        (tmp_path / name).touch()
    for name in (forces, other, "walk_1_forces"):
        (tmp_path / f"{name}.mot").write_text("x\nendheader\ntime\tground_force_vx\tground_force_vy\n")
    result = draft(tmp_path, completed(init_subject(tmp_path)))
    found = {trial.name: trial.forces and trial.forces.name for trial in result.trials}
    assert found == {trial: f"{forces}.mot", "walk_1": "walk_1_forces.mot"}


def laboratory(tmp_path, sample_walk, force_folder):
    """Markers of a person in a folder, forces in another one."""
    person = tmp_path / "person"
    for name in ("MarkerData", force_folder):
        (person / name).mkdir(parents=True)
    data = sample_walk / "gait2354"
    for name in ("subject01_static.trc", "subject01_walk1.trc"):
        shutil.copy(data / name, person / "MarkerData")
    for name in ("subject01_walk1_grf.mot", "subject01_walk1_grf.xml"):
        shutil.copy(data / name, person / force_folder)
    return person


@pytest.mark.parametrize("force_folder", ["ID", "MarkerData/forces"])
def test_init_finds_forces_in_folders_beside_and_within(tmp_path, sample_walk, force_folder):
    person = laboratory(tmp_path, sample_walk, force_folder)
    path = person / "MarkerData" / "subject.toml"
    text = init_subject(path.parent)
    beside = "../ID" if force_folder == "ID" else "forces"
    assert f'forces = "{beside}/subject01_walk1_grf.mot"' in text
    assert f'loads = "{beside}/subject01_walk1_grf.xml"' in text
    assert "No forces" not in text
    (trial,) = draft(path.parent, completed(text)).trials
    assert trial.forces.samefile(person / force_folder / "subject01_walk1_grf.mot")


def test_init_finds_forces_in_a_folder_of_forces_beside_the_one_above(tmp_path, sample_walk):
    person = laboratory(tmp_path, sample_walk, "ForceData")
    folder = person / "MarkerData" / "Mocap"
    folder.mkdir()
    for file in [file for file in folder.parent.iterdir() if file.is_file()]:
        file.rename(folder / file.name)
    assert 'forces = "../../ForceData/subject01_walk1_grf.mot"' in init_subject(folder)
    (person / "ForceData").rename(person / "ID")
    assert "# No forces were found for subject01_walk1.trc" in init_subject(folder)


def test_init_leaves_folders_alone_that_it_may_not_look_into(tmp_path, monkeypatch):
    here, locked = tmp_path / "here", tmp_path / "locked"
    for folder in (here, locked):
        folder.mkdir()
    (here / "walk.trc").touch()
    listed = Path.iterdir

    def iterdir(folder):
        if folder == locked:
            raise PermissionError(13, "Permission denied", str(folder))
        return listed(folder)

    monkeypatch.setattr(Path, "iterdir", iterdir)
    assert 'markers = "walk.trc"' in init_subject(here)


def test_init_leaves_other_persons_forces_alone_and_says_so(tmp_path, sample_walk):
    person = laboratory(tmp_path, sample_walk, "ID")
    shutil.copy(sample_walk / "gait2354" / "subject01_walk1.trc", person / "ID" / "subject02_walk1.trc")
    text = init_subject(person / "MarkerData")
    assert "# No forces were found for subject01_walk1.trc" in text
    assert "# forces = " in text
    with refused("F108", problem="its folders ID, MarkerData do"):
        init_subject(person)


def test_init_takes_neither_hidden_twins_nor_results_of_kinertia(tmp_path):
    """Archives of Macs have a hidden twin of every file; results beside recordings hold motion files and loads, too."""
    # two folders below the tests' own, whose names may have "force" in them
    folder, out = tmp_path / "study" / "Anna", tmp_path / "study" / "out"
    for place in (folder, out):
        place.mkdir(parents=True)
    for name in ("static.trc", "walk.trc", "._walk.trc", "._other.c3d"):
        (folder / name).touch()
    for name, content in (
        ("fit.json", "{}"),
        ("external_loads.xml", "<ExternalLoads />"),
        ("ground_reactions.mot", "time\tplate_vx\n"),
    ):
        (out / name).write_text(content, encoding="utf-8")
    text = init_subject(folder)
    assert "._" not in text
    assert "out/" not in text
    assert "# No forces were found for walk.trc" in text


def test_init_prefers_c3d_to_its_export_and_says_so(tmp_path):
    for name in ("static.trc", "walk.c3d", "walk.trc"):
        (tmp_path / name).touch()
    text = init_subject(tmp_path)
    assert 'markers = "walk.c3d"' in text
    assert re.search("Left out.*walk.trc", text)


@pytest.mark.parametrize("name", ["static.trc", "walk.trc"])
def test_init_with_one_recording_leaves_the_other_to_fill_in(tmp_path, name):
    (tmp_path / name).touch()
    text = init_subject(tmp_path)
    missing = '# markers = "walk.trc"' if name == "static.trc" else '# static = "static.trc"'
    assert f"{missing}  # FILL IN" in text
    if name == "walk.trc":
        assert draft(tmp_path, completed(text)).model.static is None  # the walk has to do
        return
    with pytest.raises(FileError):
        draft(tmp_path, completed(text))


def test_init_explains_every_setting(tmp_path):
    (tmp_path / "walk.trc").touch()
    lines = init_subject(tmp_path).splitlines()
    for name in Settings.model_fields:
        assert any(re.match(rf"(# )?{name} = .+  # .{{10,}}", line) for line in lines)


def test_init_without_recordings(tmp_path):
    with refused("F108", problem="no file of markers (.trc"):
        init_subject(tmp_path)
    with refused("F101", file="nowhere"):
        init_subject(tmp_path / "nowhere")


def test_the_only_model_takes_the_place_of_a_static_trial_that_no_name_tells(tmp_path, c3d_lab):
    for name in ("first.c3d", "second.c3d"):
        shutil.copyfile(c3d_lab / "static.c3d", tmp_path / name)
    (tmp_path / "scaled.osim").touch()
    content = tomllib.loads(init_subject(tmp_path))
    assert content["model"] == {"osim": "scaled.osim"}
    assert [trial["markers"] for trial in content["trial"]] == ["first.c3d", "second.c3d"]
    (tmp_path / "generic.osim").touch()
    two = init_subject(tmp_path)
    assert "osim" not in tomllib.loads(two)["model"], "which of two is not for us to say"
    assert [f'# osim = "{name}.osim"' in two for name in ("generic", "scaled", "other")] == [True, True, False]
    (tmp_path / "generic.osim").unlink()
    (tmp_path / "first.c3d").rename(tmp_path / "static.c3d")
    assert tomllib.loads(init_subject(tmp_path))["model"] == {"static": "static.c3d"}


@pytest.mark.parametrize("place", ["Models", "OpenSimData/Model"])
def test_models_nearby_are_commented_lines(tmp_path, c3d_lab, place):
    """As AddBiomechanics and OpenCap place them."""
    folder = tmp_path / "MarkerData"
    for place_of_model in (folder, tmp_path / place, tmp_path / "Ben" / "Model"):
        place_of_model.mkdir(parents=True)
    shutil.copyfile(c3d_lab / "static.c3d", folder / "walk.c3d")
    (tmp_path / place / "final.osim").touch()
    (tmp_path / "Ben" / "Model" / "bens.osim").touch()
    text = init_subject(folder)
    assert f'# osim = "../{place}/final.osim"' in text
    assert "bens" not in text
    assert "osim" not in tomllib.loads(text)["model"], "which model is not for us to say"
    assert "final" not in init_subject(folder, nearby=False)


def test_forces_nearby_are_looked_for_unless_told_not_to(tmp_path):
    folder = tmp_path / "Anna"
    folder.mkdir()
    (folder / "walk.trc").write_text("PathFileType\n")
    (tmp_path / "forces").mkdir()
    (tmp_path / "forces" / "walk.mot").write_text("ground_force_vx ground_force_vy\n")
    assert tomllib.loads(init_subject(folder))["trial"][0]["forces"] == "../forces/walk.mot"
    assert "forces" not in tomllib.loads(init_subject(folder, nearby=False))["trial"][0]


FORCES = "forces\nversion=1\nnRows=1\nnColumns=3\ninDegrees=no\nendheader\ntime\tFP1_Fx\tFP1_Fy\tFP1_Fz\n0\t0\t0\t0\n"


def test_columns_of_any_name_are_forces_where_external_loads_say_so(tmp_path):
    folder = tmp_path / "study" / "person"
    folder.mkdir(parents=True)
    trc(folder / "static.trc", 3)
    trc(folder / "walk.trc", 30)
    (folder / "walk_grf.mot").write_text(FORCES)
    (folder / "walk_ik.mot").write_text(FORCES.replace("FP1_F", "pelvis_t"))
    text = init_subject(folder)
    assert "walk_grf.mot: no columns like ground_force_vx; rename them, or put the ExternalLoads file" in text
    assert "walk_ik.mot" not in text
    loads = "<ExternalLoads><ExternalForce><force_identifier> FP1_F </force_identifier></ExternalForce></ExternalLoads>"
    (folder / "walk_loads.xml").write_text(loads)
    text = init_subject(folder)
    assert 'forces = "walk_grf.mot"' in text
    assert 'loads = "walk_loads.xml"' in text
    assert "No forces" not in text


def test_folders_that_hold_markers_are_named_however_deep(tmp_path):
    for folder, name in (("Static", "cal"), ("Walking/trial1", "markers")):
        (tmp_path / folder).mkdir(parents=True)
        trc(tmp_path / folder / f"{name}.trc", 3)
    with refused("F108", problem="its folders Static, Walking/trial1 do"):
        init_subject(tmp_path)


def test_a_sheet_of_measures_is_taken_up(tmp_path, c3d_lab):
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(c3d_lab / name, tmp_path / name)
    assert "prior" not in tomllib.loads(init_subject(tmp_path))
    (tmp_path / "measures.csv").write_text(measures_sheet(), encoding="utf-8")
    text = init_subject(tmp_path)
    assert tomllib.loads(text)["prior"] == {"measures": "measures.csv"}
    assert draft(tmp_path, completed(text)).prior.measures == (tmp_path / "measures.csv").resolve()
    (tmp_path / "spring.csv").write_text(measures_sheet(), encoding="utf-8")
    assert '# measures = "measures.csv"  # FILL IN' in init_subject(tmp_path), "which of two is not for us to say"
    (tmp_path / "static.c3d").rename(tmp_path / "stand.c3d")
    (tmp_path / "scaled.osim").touch()
    assert "measures =" not in init_subject(tmp_path), "a model cuts its segments elsewhere"


def moving_trc(path, frames, speed_m_s):
    """Markers that all move at this speed."""
    trc(path, frames)
    head = path.read_text().split("\n")[:6]
    rows = [f"{k + 1}\t{k / 100:.2f}\t{speed_m_s * 10 * k:.2f}\t2\t3" for k in range(frames)]
    path.write_text("\n".join([*head[:5], "", *rows]) + "\n")


def test_init_takes_no_short_walk_for_a_static_trial(tmp_path):
    moving_trc(tmp_path / "a.trc", 60, 1.1)
    moving_trc(tmp_path / "b.trc", 200, 0.01)
    moving_trc(tmp_path / "c.trc", 300, 0.0)
    text = init_subject(tmp_path)
    assert 'static = "b.trc"' in text
    assert "the shortest in which nobody moves" in text


def test_init_takes_no_static_trial_where_all_move(tmp_path):
    moving_trc(tmp_path / "a.trc", 60, 1.1)
    moving_trc(tmp_path / "b.trc", 200, 0.6)
    text = init_subject(tmp_path)
    assert '# static = "static.trc"  # FILL IN' in text
    assert text.count("[[trial]]") == 2


def standing_trc(path, labels):
    """Somebody who stands, in a file, by these labels."""
    write_trc(path, recording(labels, frames=30).markers)


def test_init_drafts_a_marker_set_where_no_preset_fits(tmp_path):
    positions = standing_positions()
    standing_trc(tmp_path / "static.trc", {f"Q{k}": at for k, at in enumerate(positions.values())})
    files = init_files(tmp_path)
    assert set(files) == {"subject.toml", "markers.toml"}
    assert 'markers = "markers.toml"' in files["subject.toml"]
    (tmp_path / "markers.toml").write_text(files["markers.toml"], encoding="utf-8")
    assert "heel_r" in read_marker_set(tmp_path / "markers.toml").landmarks
    again = init_files(tmp_path)
    assert set(again) == {"subject.toml"}, "what is there is left alone"
    assert again["subject.toml"] == files["subject.toml"]


def test_init_drafts_a_marker_set_from_a_walk_where_nobody_stands(tmp_path):
    """Labels that no preset knows."""
    labels = {f"{name[0]}Q{name[2:]}" if name[1] == "." else name: at for name, at in standing_positions().items()}
    walk = recording(labels, frames=100)
    walk.markers.positions[:, :, 0] += 1.2 * walk.markers.time[:, None]
    write_trc(tmp_path / "walk1.trc", walk.markers)
    files = init_files(tmp_path)
    assert set(files) == {"subject.toml", "markers.toml"}
    assert '# static = "static.trc"  # FILL IN' in files["subject.toml"]
    (tmp_path / "markers.toml").write_text(files["markers.toml"], encoding="utf-8")
    assert {"heel_r", "heel_l", "asis_r"} <= set(read_marker_set(tmp_path / "markers.toml").landmarks)


def test_init_does_not_use_a_marker_set_that_cannot_be_right(tmp_path):
    names = {"R.Knee.Med": "R.Innen", "L.Knee.Med": "L.Innen"}
    positions = {names.get(label, label): at for label, at in standing_positions().items()}
    positions["R.Innen"] = positions["R.Knee.Lat"] + np.array([0.07, 0.0, -0.06])
    standing_trc(tmp_path / "static.trc", positions)
    files = init_files(tmp_path)
    (line,) = [line for line in files["subject.toml"].splitlines() if NOT_USED in line]
    assert line.startswith('# markers = "markers.toml"')
    assert "NOTE: this cannot be right" in files["markers.toml"]


def test_init_drafts_no_marker_set_where_a_preset_fits(tmp_path):
    standing_trc(tmp_path / "static.trc", standing_positions())
    files = init_files(tmp_path)
    assert set(files) == {"subject.toml"}
    assert '# markers = "cleveland-clinic"' in files["subject.toml"]


NEXUS = """$Bodymass = 61.5
$Height = 1702
$InterAsisDistance = 0
$LKneeWidth = 102
$RKneeWidth = 104.5
$LAnkleWidth = 71,5
$RAnkleWidth = 0
$LElbowWidth = 900
"""


def test_measures_of_nexus_are_drafted_where_no_recording_states_them(tmp_path, sample_walk):
    for name in ("subject01_static.trc", "subject01_walk1.trc", "subject01_walk1_grf.mot"):
        shutil.copy(sample_walk / "gait2354" / name, tmp_path)
    (tmp_path / "Anna.mp").write_text(NEXUS, encoding="utf-8")
    subject = tomllib.loads(init_subject(tmp_path))["subject"]
    assert subject == {"mass_kg": 61.5, "height_m": 1.702, "knee_width_mm": 103.2, "ankle_width_mm": 71.5}
    stated = tomllib.loads(init_files(tmp_path, stated={"mass_kg": 60.0})["subject.toml"])["subject"]
    assert (stated["mass_kg"], stated["height_m"]) == (60.0, 1.702)
    (tmp_path / "Ben.mp").write_text(NEXUS, encoding="utf-8")
    assert tomllib.loads(init_subject(tmp_path))["subject"] == {}, "of two people, nobody knows whose"


def test_a_c3d_file_that_states_mass_and_stature_precedes_measures_of_nexus(tmp_path, c3d_lab):
    for file in c3d_lab.iterdir():
        shutil.copy(file, tmp_path)
    stated = tomllib.loads(init_subject(tmp_path))["subject"]
    (tmp_path / "Anna.mp").write_text(NEXUS, encoding="utf-8")
    both = tomllib.loads(init_subject(tmp_path))["subject"]
    assert both.items() >= stated.items()
