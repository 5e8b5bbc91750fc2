"""Masses and inertias that are placeholders, unlike the tables, asymmetric or not this person's."""

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
from recordings import here
from upright_model import changed, with_moments

PERSON = {"mass_kg": upright.MASS_KG, "height_m": upright.HEIGHT_M, "sex": upright.SEX}


def findings(bsp=None, arms=True, trials=(), **person):
    """Of a model beside this person, those that no other one explains."""
    body = upright.bsp(arms) if bsp is None else bsp
    context = replace(with_model(upright.skeleton(arms), body, **person), trials=trials)
    return [finding for finding in explained(asked(MODEL_CHECKS, context)) if finding.is_open]


def answers(code, *arguments, **more):
    return [finding for finding in findings(*arguments, **more) if finding.code == code]


def test_dumas_own_model_has_nothing_against_it():
    assert findings(**PERSON) == []


def test_what_is_not_known_of_the_person_is_left_out():
    (finding,) = findings()
    assert (finding.code, finding.severity) == ("O415", Severity.INFO)
    assert "mass and stature and sex" in finding.evidence["reason"].value
    (finding,) = findings(mass_kg=75.0, height_m=1.77)
    assert "sex not stated" in finding.evidence["reason"].value
    assert answers("O415", trials=[UNMOVED]) == [], "nobody asked for a comparison"


@pytest.mark.parametrize(
    ("moments", "pattern"),
    [
        ((1.0, 1.0, 1.0), "three equal"),
        ((0.0014, 0.0039, 0.0041), "rounded"),
        ((0.00141, 0.0039, 0.0041), None),
    ],
)
def test_placeholders(moments, pattern):
    found = answers("O211", with_moments("talus_r", *moments))
    assert [finding.evidence["pattern"].value for finding in found] == ([] if pattern is None else [pattern])
    assert {finding.where.part for finding in found} <= {"talus_r"}


@pytest.mark.parametrize(
    ("mass_kg", "alone", "fitted"),
    [
        (75.5, [], []),
        (78.0, [Severity.WARNING], []),
        (60.0, [Severity.ERROR], [Severity.WARNING]),
    ],
)
def test_total_mass(mass_kg, alone, fitted):
    """A fit scales the masses."""
    stated = {**PERSON, "mass_kg": mass_kg}
    assert [answer.severity for answer in answers("O213", **stated)] == alone
    assert [answer.severity for answer in answers("O213", trials=[UNMOVED], **stated)] == fitted


def test_legs_without_a_trunk_are_not_scaled_to_the_whole_mass():
    """Thighs and shanks would be twice as heavy as they are."""
    zero = dict.fromkeys(PARAMETERS, 0.0)
    (finding,) = answers("O213", changed("torso", **zero), trials=[UNMOVED], **PERSON)
    assert finding.severity is Severity.ERROR
    body = upright.bsp()
    table = body.table()
    pelvis, torso = (body.segments.index(name) for name in ("pelvis", "torso"))
    table[pelvis, 0], table[torso] = table[pelvis, 0] + table[torso, 0], 0.0
    in_pelvis = BodySegmentParameters.from_table(body.segments, table)
    assert answers("O213", in_pelvis, trials=[UNMOVED], **PERSON) == []


def test_left_and_right():
    bsp = upright.bsp()
    mass = bsp.mass_kg[bsp.segments.index("tibia_r")]
    (finding,) = answers("O214", changed("tibia_r", mass=1.05 * mass, com_z=0.02))
    assert finding.where.part == "tibia"
    assert finding.evidence["mass_share"].value == pytest.approx(0.05, abs=0.005)
    assert finding.evidence["com_m"].value > 0.015


def test_segments_unlike_the_literature():
    """In a fit it is advice: the model is where the estimate starts from."""
    bsp = upright.bsp()
    table = bsp.table()
    for side in "rl":
        table[bsp.segments.index(f"femur_{side}"), [0, *range(4, 10)]] *= 2.5
    heavy = BodySegmentParameters.from_table(bsp.segments, table)
    found = answers("O212", heavy, **PERSON)
    assert [(finding.where.part, finding.severity) for finding in found] == [
        ("femur_r", Severity.WARNING),
        ("femur_l", Severity.WARNING),
    ]
    for finding in found:
        assert finding.evidence["value"].value > finding.evidence["table_high"].value
    scaled = replace(heavy, mass_kg=heavy.mass_kg * 75.0 / heavy.total_mass_kg)
    assert {answer.severity for answer in answers("O212", scaled, trials=[UNMOVED], **PERSON)} == {Severity.INFO}


def test_torso_with_the_arms_inertia():
    """Rajagopal's torso, on this model; without arms as bodies it may."""
    bsp = changed("torso", mass=26.8266, ixx=1.4745, iyy=0.7555, izz=1.4314, ixy=0, ixz=0, iyz=0)
    (finding,) = answers("O215", bsp, **PERSON)
    assert finding.evidence["ratio"].value == pytest.approx(0.52, abs=0.01)
    assert "torso" not in [reported.where.part for reported in answers("O212", bsp, **PERSON)], "which explains it"
    kept = [name for name in bsp.segments if not name.startswith(("humerus", "ulna", "hand"))]
    bare = BodySegmentParameters.from_table(kept, [bsp.table()[bsp.segments.index(name)] for name in kept])
    assert answers("O215", bare, False) == []


def test_without_arms_the_torso_weighs_torso_and_arms():
    bsp = upright.bsp(arms=False)
    mass = np.array(bsp.mass_kg)
    mass[bsp.segments.index("torso")] += upright.bsp().total_mass_kg - bsp.total_mass_kg
    (finding,) = findings(replace(bsp, mass_kg=mass), False, **PERSON)
    assert finding.code == "O415"
    assert "no arms" in finding.evidence["reason"].value


def test_mass_centres_in_millimetres():
    bsp = upright.bsp()
    (finding,) = answers("O301", replace(bsp, com_m=1000.0 * bsp.com_m))
    assert (finding.severity, "torso" in finding.evidence["what"].value) == (Severity.ERROR, True)


def test_a_model_without_markers():
    """A simulation needs none."""
    bare = replace(upright.skeleton(), markers=())
    alone = asked(MODEL_CHECKS, with_model(bare, upright.bsp(), **PERSON))
    fitted = asked(MODEL_CHECKS, replace(with_model(bare, upright.bsp(), **PERSON), trials=[UNMOVED]))
    assert [finding.severity for finding in alone if finding.code == "O106"] == [Severity.INFO]
    assert [finding.severity for finding in fitted if finding.code == "O106"] == [Severity.ERROR]


def test_a_model_without_a_foot():
    without = replace(upright.skeleton(), joints=upright.skeleton().joints[:2])
    bsp = upright.bsp()
    rows = [bsp.segments.index(name) for name in without.segments]
    body = BodySegmentParameters.from_table(without.segments, bsp.table()[rows])
    found = asked(MODEL_CHECKS[:1], replace(with_model(without, body), trials=[UNMOVED]))
    assert [(finding.code, finding.where.part) for finding in found] == [("O107", "right foot"), ("O107", "left foot")]


KNOWN = {
    "synthetic/scaled.osim": ({"mass_kg": 70.0, "height_m": 1.803, "sex": "male"}, {"O213"}),
    "gait2354/subject01_scaled.osim": ({"mass_kg": 72.6, "height_m": 1.803, "sex": "male"}, {"O205", "O211", "O212"}),
    "gait2354/gait2354_simbody.osim": ({}, {"O205", "O211"}),
    "rajagopal_walk/Rajagopal2016.osim": ({}, {"O205", "O211", "O215"}),
    "rajagopal_walk/scaled.osim": ({"mass_kg": 85.0, "height_m": 1.83, "sex": "male"}, {"O212", "O215"}),
    "subject4/addbiomechanics_scaled.osim": (
        {"mass_kg": 60.0, "height_m": 1.7, "sex": "female"},
        {"O212", "O213", "O215"},
    ),
}


@pytest.mark.parametrize("name", here(KNOWN))
def test_models_in_use(file_of, name):
    """None is impossible; those with arms carry them twice, which is known of them."""
    person, codes = KNOWN[name]
    model = read_osim(file_of(name))
    found = asked(MODEL_CHECKS, with_model(model.skeleton, model.bsp, **person))
    assert max(finding.severity for finding in found) <= Severity.WARNING
    assert {finding.code for finding in found if finding.severity == Severity.WARNING} == codes
