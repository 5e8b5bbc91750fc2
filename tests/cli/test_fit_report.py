"""A fit that is refused because no marker set fits says which commands lead to one."""

import pytest

from generic_static import recording, standing_positions
from kinertia.cli.fit_report import next_commands
from kinertia.errors import MarkerSetError, SubjectError
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.subject.tables import Model
from kinertia.model.gait27 import build_gait27

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
