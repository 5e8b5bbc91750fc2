"""A squat with one foot on a plate that works: the moments of that leg, and instruments from another trial."""

import json

import numpy as np
import pytest

from kinertia.io.text.sto import TimeTable, read_table, write_table
from kinertia.io.text.trc import read_trc, write_trc
from kinertia.report.exports.saved_fit import load_fit
from kinertia.workflow.from_files import fit_subject
from recordings import is_here
from validation.measured_data import find

FILES = [f"subject4/{name}" for name in ("squats1.trc", "squats1_grf.mot", "walking1.trc", "walking1_grf.mot")]
MODEL = "subject4/addbiomechanics_scaled.osim"
UNTIL_S = 2.5
pytestmark = [
    pytest.mark.slow,
    pytest.mark.measured,
    pytest.mark.skipif(not is_here([*FILES, MODEL]), reason="need measured recordings"),
]


@pytest.fixture(scope="module", params=[True, False], ids=["with a walk", "alone"])
def fit(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("squat")
    write_trc(folder / "squat.trc", read_trc(find(FILES[0])).cut(0.0, UNTIL_S))
    loads = read_table(find(FILES[1]))
    rows = loads.time <= UNTIL_S
    silent = ["ground_force_2" in label for label in loads.labels]
    values = np.where(silent, 0.0, loads.values)[rows]
    write_table(folder / "squat.mot", TimeTable(loads.time[rows], loads.labels, values, False), "squat")
    trials = [("squat.trc", "squat.mot")] + [(find(FILES[2]), find(FILES[3]))] * request.param
    text = f'[subject]\nname = "A"\nsex = "male"\nmass_kg = 62.6\n\n[model]\nosim = "{find(MODEL)}"\n'
    text += "".join(f'\n[[trial]]\nmarkers = "{markers}"\nforces = "{forces}"\n' for markers, forces in trials)
    (folder / "subject.toml").write_text(text)
    return request.param, fit_subject(folder / "subject.toml")


def test_moments_of_the_leg_on_its_plate_alone(fit, tmp_path):
    with_walk, result = fit
    squat = result.trials[0]
    assert not squat.kinematics.complete
    (found,) = [finding for finding in result.findings if finding.code == "P290"]
    assert found.where.trial == "squat"
    curves = squat.joint_curves
    joints = curves.joints["estimate"]
    right, left = (joints.moments[:, joints.joints.index(f"knee_{side}"), 0] for side in "rl")
    assert np.isfinite(right).mean() > 0.9
    assert np.isnan(left).all()
    assert 20.0 < np.nanmax(np.abs(right)) < 120.0
    assert np.isnan(squat.residuals["estimate"]).all()
    # instruments that no trial shows may be off by anything: no error bars, rather than short ones
    assert np.isfinite(curves.moment_sd[np.isfinite(joints.moments)]).all() == with_walk
    result.save(tmp_path / "out")
    written = json.loads((tmp_path / "out" / "fit.json").read_text(), parse_constant=pytest.fail)
    assert written["trials"][0]["residual_force_rms_N"]["estimate"] is None
    again = load_fit(tmp_path / "out").trials[0]
    np.testing.assert_array_equal(again.joint_curves.joints["estimate"].moments, joints.moments)
