"""Masses and inertias that no body can have are found, alone and with trials; those of models in use are not."""

from dataclasses import replace

import numpy as np
import pytest

import upright_model as upright
from kinertia.diagnostics.registry import MODEL_CHECKS
from kinertia.diagnostics.runner import asked, explained
from kinertia.findings.finding import Severity
from kinertia.io.opensim.reader import read_osim
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters
from people import UNMOVED, with_model
from sound_models import MODELS
from upright_model import changed, with_moments


def found(bsp, trials=()):
    """Code, body and severity of what speaks against mass properties and is not explained by another."""
    context = replace(with_model(upright.skeleton(), bsp), trials=trials)
    questions = [check for check in MODEL_CHECKS if check.codes[0].startswith("O20")]
    return {
        (finding.code, finding.where.part, finding.severity)
        for finding in explained(asked(questions, context))
        if finding.is_open
    }


def ball(mass_kg, density_kg_m3):
    """The upright model with a femur that is a ball."""
    radius = (mass_kg / (4.0 / 3.0 * np.pi * density_kg_m3)) ** (1.0 / 3.0)
    return with_moments("femur_r", *[0.4 * mass_kg * radius**2] * 3, mass=mass_kg)


def test_a_possible_model():
    assert found(upright.bsp()) == set()
    assert found(upright.bsp(), [UNMOVED]) == set()


@pytest.mark.parametrize("trials", [(), [UNMOVED]])
@pytest.mark.parametrize(
    ("mass", "inertia", "expected"),
    [(1000.0, 1.0, True), (1000.0, 1000.0, True), (0.001, 0.001, True), (2.20462, 1.0, False), (0.5, 0.5, False)],
)
def test_masses_in_another_unit_are_one_error(mass, inertia, expected, trials):
    """In grams they were 22 warnings about inertias, and the fit scaled the masses and went on."""
    usual = upright.bsp()
    bsp = BodySegmentParameters(usual.segments, mass * usual.mass_kg, usual.com_m, inertia * usual.inertia_kgm2)
    assert (found(bsp, trials) == {("O206", None, Severity.ERROR)}) == expected


@pytest.mark.parametrize(
    ("change", "condition"),
    [
        ({"ixx": 0.5}, "triangle inequality iyy + izz > ixx violated by"),
        ({"iyy": -0.01}, "iyy is -0.01 kg m2, not positive"),
        ({"ixy": 0.15}, "ixy, ixz, iyz are too large"),
        ({"mass": 0.0}, "mass is 0 kg, not positive"),
    ],
)
def test_what_no_distribution_of_mass_has(change, condition):
    """With trials, too: it was a warning in a fit, and nothing in a check of all files."""
    bsp = changed("femur_r", **change)
    assert ("O201", "femur_r", Severity.ERROR) in found(bsp)
    context = with_model(upright.skeleton(), bsp)
    (finding,) = (reported for reported in asked(MODEL_CHECKS, context) if reported.code == "O201")
    assert condition in finding.evidence["condition"].value
    if "mass" not in change:
        assert ("O201", "femur_r", Severity.ERROR) in found(bsp, [UNMOVED])


def test_bodies_that_a_fit_does_not_estimate():
    """Toes of 0.1 kg keep what the model has."""
    light = with_moments("toes_r", 0.001, 0.0001, 0.0001, mass=0.1)
    assert found(light) == {("O201", "toes_r", Severity.ERROR)}
    assert found(light, [UNMOVED]) == {("O201", "toes_r", Severity.INFO)}


@pytest.mark.parametrize(("density", "codes"), [(1000.0, set()), (4990.0, set()), (8000.0, {"O203"})])
def test_a_ball_is_as_dense_as_it_is(density, codes):
    assert {code for code, _, _ in found(ball(5.0, density))} == codes
    (finding, *_) = [
        reported
        for reported in asked(MODEL_CHECKS, with_model(upright.skeleton(), ball(5.0, 8000.0)))
        if reported.code == "O203"
    ]
    assert finding.evidence["density_kg_m3"].value == pytest.approx(8000.0)


def test_light_bodies_are_not_dense():
    assert found(ball(0.1, 8000.0)) == set()


def test_mass_in_a_point(recwarn):
    """No ratio is made of two zeros."""
    none = dict.fromkeys(PARAMETERS[4:], 0.0)
    assert found(changed("femur_r", **none)) == {("O202", "femur_r", Severity.ERROR)}
    assert found(changed("femur_r", **none), [UNMOVED]) == {("O202", "femur_r", Severity.ERROR)}
    assert found(changed("talus_r", mass=0.1, **none)) == {("O202", "talus_r", Severity.WARNING)}
    assert found(changed("talus_r", mass=0.0, **none)) == set()
    assert not recwarn.list


@pytest.mark.parametrize(("mass", "severity"), [(1.0, Severity.ERROR), (0.05, Severity.WARNING)])
def test_a_unit_inertia(mass, severity):
    assert found(with_moments("talus_l", 1.0, 1.0, 1.0, mass=mass)) == {("O204", "talus_l", severity)}


def test_without_thickness():
    """In a fit it is advice: the model is where the estimate starts from."""
    thin = with_moments("talus_r", 0.001, 0.002, 0.001)
    assert found(thin) == {("O205", "talus_r", Severity.WARNING)}
    assert found(thin, [UNMOVED]) == {("O205", "talus_r", Severity.INFO)}


@pytest.mark.parametrize("name", MODELS)
def test_models_in_use(file_of, name):
    """With trials none has a fault of bodies that are estimated."""
    model = read_osim(file_of(name))
    context = replace(with_model(model.skeleton, model.bsp), trials=[UNMOVED])
    questions = [check for check in MODEL_CHECKS if check.codes[0].startswith(("O20", "O21", "O30"))]
    assert [finding for finding in asked(questions, context) if finding.severity > Severity.INFO] == []
