"""Findings on a terminal."""

from dataclasses import replace

import pytest

from found import UNEXPLAINED, ZERO
from generic_static import recording, standing_positions
from kinertia.cli.findings_view import next_commands, show_all
from kinertia.cli.terminal import out
from kinertia.errors import MarkerSetError, SubjectError
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Where
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.subject.tables import Model
from kinertia.model.gait27 import build_gait27


def test_verbose_shows_what_a_finding_explains_to_the_last_consequence_and_in_its_own_trial_only():
    last = finding("P246", Where(trial="walk", plate="plate 1")).muted("P214")
    elsewhere = replace(ZERO, where=replace(ZERO.where, trial="run"))
    with out.capture() as shown:
        show_all([ZERO, UNEXPLAINED, last, elsewhere])
    codes = [line.split()[:3] for line in shown.get().splitlines() if "P2" in line]
    assert codes == [
        ["WARNING", "walk", "P213"],
        ["explains", "walk", "P214"],
        ["explains", "walk", "P246"],
        ["WARNING", "run", "P213"],
    ]


COMMAND = "kinertia fit walk.c3d --static static.c3d"


def no_preset():
    with pytest.raises(MarkerSetError) as error:
        choose_marker_set(["A", "B"])
    return error.value


def no_landmark():
    positions = {label: at for label, at in standing_positions().items() if label != "R.Heel"}
    with pytest.raises(MarkerSetError) as error:
        build_gait27(recording(positions), read_marker_set("cleveland-clinic"), 1.75, "male")
    return error.value


def model(**more):
    return Model.model_construct(**{"static": None, "markers": None, "osim": None, **more})


@pytest.mark.parametrize("error", [no_preset, no_landmark])
def test_options_lead_to_two_commands(tmp_path, monkeypatch, error):
    monkeypatch.chdir(tmp_path)
    lines = next_commands(error(), tmp_path / "walk.c3d", model(static=tmp_path / "static.c3d"), COMMAND)
    assert lines == ["kinertia markers static.c3d -o markers.toml", f"{COMMAND} --markers markers.toml"]


def test_a_subject_file_gets_the_marker_set_beside_it(tmp_path):
    wanted = model(static=tmp_path / "static.c3d")
    lines = next_commands(no_preset(), tmp_path / "subject.toml", wanted, "kinertia fit subject.toml")
    assert lines[0].endswith(f"-o {tmp_path / 'markers.toml'}")
    assert 'markers = "markers.toml" under [model]' in lines[1]
    assert lines == next_commands(no_preset(), tmp_path, wanted, "kinertia fit subject.toml")


def test_nothing_is_said_where_it_would_not_help(tmp_path):
    static = {"static": tmp_path / "static.c3d"}
    walk = tmp_path / "walk.c3d"
    assert next_commands(SubjectError("mass_kg", 0, "give one"), walk, model(**static), COMMAND) == []
    assert next_commands(no_preset(), walk, model(), COMMAND) == []
    assert next_commands(no_preset(), walk, model(**static, markers=tmp_path / "own.toml"), COMMAND) == []
