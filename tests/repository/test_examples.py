import re
from pathlib import Path

import pytest

import fit_gait2354
import kinertia


@pytest.mark.usefixtures("few_evaluations")
def test_step_by_step_example_runs(shared_data, capsys):
    bsp = fit_gait2354.main(shared_data / "gait2354", (0.5, 0.9))
    shown = capsys.readouterr().out
    forces = [float(force) for force in re.findall(r"([\d.]+) N +[\d.]+ N m", shown)]
    assert len(forces) == 3
    assert forces == sorted(forces, reverse=True)
    assert bsp.total_mass_kg == pytest.approx(72.6, rel=0.1)


def test_every_exported_name_is_there():
    for name in kinertia.__all__:
        assert getattr(kinertia, name).__doc__


def test_citation_names_this_version():
    text = (Path(__file__).parents[2] / "CITATION.cff").read_text()
    assert f"\nversion: {kinertia.__version__}\n" in text
