"""Subject files with an OpenSim model."""

import pytest

from refusals import refused
from whole_subject_file import changed, read

OWN = """\
[subject]
mass_kg = 61.5

[model]
osim = "scaled.osim"

[[trial]]
markers = "data/walk1.trc"
"""


def test_an_opensim_model_needs_neither_static_trial_nor_sex(folder):
    (folder / "scaled.osim").touch()
    result = read(folder, OWN)
    assert result.model.osim == folder / "scaled.osim"
    assert (result.model.static, result.subject.sex, result.model.calibrate) == (None, None, False)
    assert read(folder, OWN.replace("[[trial]]", "calibrate = true\n[[trial]]")).model.calibrate


@pytest.mark.parametrize(
    ("old", "new", "line", "code", "evidence"),
    [
        ("osim = ", 'static = "static.trc"\nosim = ', 5, "F193", {"one": "osim", "other": "static"}),
        ("osim = ", 'markers = "plug-in-gait"\nosim = ', 5, "F193", {"one": "osim", "other": "markers"}),
        ('osim = "scaled.osim"', 'static = "static.trc"', 1, "F191", {"entry": "[subject] lacks 'sex'"}),
        ("[[trial]]", '[settings]\nmethod = "two-level"\n[[trial]]', 8, "F193", {"one": "two-level", "other": "osim"}),
        ('osim = "scaled.osim"', 'osim = "scald.osim"', 5, "F101", {"key": "osim", "nearest": "scaled.osim"}),
    ],
)
def test_what_does_not_go_with_an_opensim_model(folder, old, new, line, code, evidence):
    (folder / "scaled.osim").touch()
    with refused(code, line, **evidence):
        read(folder, OWN.replace(old, new))


def test_calibration_is_of_opensim_models(folder):
    with refused("F193", 8, one="calibrate"):
        read(folder, changed('markers = "plug-in-gait"', "calibrate = true"))
