"""Masses that an estimate found against stated ones and against forces."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.masses import attached_items, forces_of_the_motion, total_mass
from kinertia.estimation.prepare.prepared import TotalMass
from kinertia.settings import Attached
from kinertia.synthetic.walk import walking_subject

LITERATURE = walking_subject().literature


@pytest.mark.parametrize(
    ("estimated", "stated", "expected"), [(0.96, 1.0, ["S113"]), (0.98, 1.0, []), (1.0, 0.96, ["S113"])]
)
def test_a_total_mass_that_follows_the_plates(estimated, stated, expected):
    mass_kg = LITERATURE.total_mass_kg
    fit = SimpleNamespace(estimate=replace(LITERATURE, mass_kg=estimated * LITERATURE.mass_kg))
    ready = SimpleNamespace(total_mass=TotalMass.of(stated * mass_kg, ()))
    found = list(total_mass(ResultContext(fit, ready)))
    assert [one.code for one in found] == expected
    assert all(one.evidence["estimate_kg"].value == pytest.approx(estimated * mass_kg) for one in found)


def test_a_motion_that_the_forces_do_not_make_accuses_inverse_kinematics_alone(short_fit):
    trial, ready = short_fit.trials[0], SimpleNamespace(skeleton=short_fit.skeleton, literature=short_fit.literature)
    force = trial.kinematics.foot_loads[:, :, 1].sum(axis=1).mean()
    wrong = {**trial.residuals, "literature": trial.residuals["literature"] + 0.3 * force * np.eye(6)[1]}
    made = ResultContext(SimpleNamespace(trials=[replace(trial, residuals=wrong)]), ready)
    (found,) = forces_of_the_motion(made)
    assert (found.code, found.where.trial) == ("R107", trial.name)
    by_markers = made.force_masses[trial.name].mass_kg
    assert found.evidence["by_markers_kg"].value == by_markers
    assert abs(found.evidence["by_motion_kg"].value - by_markers) > 10.0
    assert list(forces_of_the_motion(ResultContext(SimpleNamespace(trials=[trial]), ready))) == []


@pytest.mark.parametrize(
    ("mass_kg", "sd", "expected"), [("unknown", 0.51, 1), ("unknown", 0.46, 0), ("0.2 +- 0.5", 0.51, 0)]
)
def test_an_item_that_does_not_differ_from_nothing(mass_kg, sd, expected):
    pack = Attached(name="rucksack", segment="torso", mass_kg=mass_kg, com_mm=[-200, 300, 0], on_scale=False)
    estimate = SimpleNamespace(segments=("torso", "rucksack"), mass_kg=np.array([30.0, 7.26]))
    deviations = np.full((2, 10), sd * 7.26)
    fit = SimpleNamespace(estimate=estimate, posterior=SimpleNamespace(sd=deviations))
    found = list(attached_items(ResultContext(fit, SimpleNamespace(attached=(pack,)))))
    assert [(one.code, one.where.part) for one in found] == [("S407", "rucksack")] * expected
    assert all(one.evidence["mass_kg"].value == 7.26 for one in found)
