import re

import pytest

import fit_gait2354
import kinertia


@pytest.mark.slow
def test_step_by_step_example_runs(measured_folder, capsys):
    fit = fit_gait2354.main(measured_folder / "gait2354", (0.7, 1.1))
    shown = capsys.readouterr().out
    forces = [float(force) for force in re.findall(r"([\d.]+) N +[\d.]+ N m", shown)]
    before, after = forces[:2]
    assert after < before
    assert fit.estimate.total_mass_kg == pytest.approx(72.6, rel=0.1)


def test_every_exported_name_is_there():
    for name in kinertia.__all__:
        assert getattr(kinertia, name).__doc__
