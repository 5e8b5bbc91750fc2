"""Estimates that did not converge, that cannot exist, or that are far from what was expected."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.soundness import attached_items, forces_of_the_motion, soundness, total_mass
from kinertia.diagnostics.runner import explained
from kinertia.estimation.prepared import TotalMass
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import MahalanobisDistance, OneSided
from kinertia.model.bsp import BodySegmentParameters
from kinertia.settings import Attached
from kinertia.synthetic.walk import walking_subject
from results import codes

BODY = BodySegmentParameters(
    ("pelvis", "thigh_r"), [10.0, 8.0], [[0, 0, 0], [0, -0.2, 0]], [np.eye(3) * 0.1, np.diag([0.15, 0.04, 0.15])]
)


class Given(SimpleNamespace):
    """Attributes of a fit, and what a fit derives from them."""

    departures, expected_source = Fit.departures, Fit.expected_source


def found(posterior=None, **changes):
    """Of a fit that is fine in all but these."""
    given = {
        "converged": True,
        "estimate": BODY,
        "literature": BODY,
        "posterior": None
        if posterior is None
        else SimpleNamespace(
            **{"mahalanobis_distance": SimpleNamespace(implausible=False), "iterations": 7, **posterior}
        ),
        "file": None,
        "expected": changes.get("literature", BODY),
        "more_known": False,
        "evaluations": 400,
    }
    return list(soundness(ResultContext(Given(**{**given, **changes}), None)))


def levels(answers):
    return [(finding.code, finding.severity.name) for finding in answers]


def test_a_good_fit_has_no_finding():
    assert found() == found(posterior={"prior_sd": np.ones((2, 10))}) == []


@pytest.mark.parametrize(("posterior", "steps"), [(None, 400), ({"prior_sd": np.ones((2, 10))}, 7)])
def test_not_converged(posterior, steps):
    (finding,) = found(posterior, converged=False)
    assert (finding.code, finding.severity.name, finding.evidence["iterations"].value) == ("R201", "ERROR", steps)


def test_impossible_segments_are_named_and_bodies_without_mass_are_not():
    table = BODY.table()
    table[1, 4:7] = 0.1, 0.5, 0.1
    wrong = BodySegmentParameters.from_table((*BODY.segments, "patella_r"), np.vstack([table, np.zeros(10)]))
    (finding,) = found(estimate=wrong, literature=wrong)
    assert levels([finding]) == [("R202", "ERROR")]
    assert (finding.evidence["segments"].value, finding.evidence["count"].value) == ("thigh_r", 1)


def test_light_bodies_that_were_kept_as_a_model_has_them_condemn_nothing():
    """The toes of LaiArnold's model, 0.2 kg, have moments of inertia that no body has."""
    toes = np.array([[0.2, 0.03, 0.0, 0.0, 1e-4, 1e-3, 1e-5, 0, 0, 0]])
    body = BodySegmentParameters.from_table((*BODY.segments, "toes_r"), np.vstack([BODY.table(), toes]))
    deviations = np.vstack([np.ones_like(BODY.table()), np.zeros(10)])
    (finding,) = found({"prior_sd": deviations}, estimate=body, literature=body, expected=body)
    assert levels([finding]) == [("R202", "INFO")]
    assert finding.evidence["segments"].value == "toes_r"


def test_a_body_without_thickness_is_let_pass():
    """The toes of OpenSim's gait2354: 0.0001 + 0.0001 = 0.0002, but not in binary."""
    toes = np.array([[0.2166, 0.0346, 0.006, -0.0175, 0.0001, 0.0002, 0.0001, 0, 0, 0]])
    flat = BodySegmentParameters.from_table((*BODY.segments, "toes_r"), np.vstack([BODY.table(), toes]))
    assert not flat.physically_consistent().all()
    assert found(estimate=flat, literature=flat) == []


def test_centre_of_mass_far_from_the_literature_where_there_is_no_prior():
    moved = replace(BODY, com_m=BODY.com_m + np.array([[0.0], [0.12]]) * [0, 1, 0])
    (finding,) = found(estimate=moved)
    assert levels([finding]) == [("R203", "ERROR")]
    assert finding.where.part == "centre of mass of the right thigh"
    assert finding.evidence["distance_m"].value == pytest.approx(0.12)
    assert found(estimate=replace(BODY, com_m=BODY.com_m + np.array([[0.0], [0.09]]) * [0, 1, 0])) == []


@pytest.mark.parametrize(("away", "expected"), [(2.9, None), (-3.1, "WARNING"), (3.9, "WARNING"), (-4.1, "ERROR")])
def test_parameters_by_prior_deviations(away, expected):
    estimate = BodySegmentParameters.from_table(BODY.segments, BODY.table() + np.eye(2, 10) * away * 0.01)
    answers = found({"prior_sd": np.full((2, 10), 0.01)}, estimate=estimate)
    assert levels(answers) == ([] if expected is None else [("R203", expected)] * 2)
    parts = [finding.where.part for finding in answers]
    assert parts == ([] if expected is None else ["mass of the pelvis", "fore-aft centre of mass of the right thigh"])
    assert all(finding.evidence["distance_sd"].value == pytest.approx(away) for finding in answers)


def test_who_is_as_was_stated_is_not_far_from_the_prior_for_being_unlike_the_literature():
    measured = BodySegmentParameters.from_table(BODY.segments, BODY.table() + 0.05 * np.eye(2, 10))
    posterior = {"prior_sd": np.full((2, 10), 0.01)}
    assert found(posterior, estimate=measured, expected=measured, more_known=True) == []
    (finding,) = found(posterior, estimate=BODY, expected=measured, more_known=True)[:1]
    assert finding.evidence["source"].value == "the prior"


@pytest.mark.parametrize(("doubted", "expected"), [(1, "WARNING"), (2, "WARNING"), (3, "ERROR")])
def test_more_than_two_doubted_segments_contradict_the_model(doubted, expected):
    """Several parameters of one segment go together and count once."""
    segments = ("pelvis", "thigh_r", "thigh_l", "torso")
    table = np.tile(BODY.table()[:1], (4, 1))
    away = table.copy()
    away[:doubted, :3] += 0.031
    before, after = (BodySegmentParameters.from_table(segments, values) for values in (table, away))
    answers = found({"prior_sd": np.full((4, 10), 0.01)}, literature=before, estimate=after)
    assert levels(answers) == [("R203", expected)] * 3 * doubted


def unlike(both_sides=False, one_sided=None, away=0.0):
    """Findings of a person unlike the prior, and those that no other explains."""
    whole = MahalanobisDistance(60.0, 12, 1e-9, ("tibia_l", "torso"), both_sides, one_sided)
    estimate = BodySegmentParameters.from_table(BODY.segments, BODY.table() + away * 0.01 * np.eye(2, 10))
    answers = explained(found({"prior_sd": np.full((2, 10), 0.01), "mahalanobis_distance": whole}, estimate=estimate))
    return [answer for answer in answers if answer.is_open]


def test_a_person_unlike_the_prior():
    (finding,) = unlike()
    assert levels([finding]) == [("R204", "WARNING")]
    assert (finding.evidence["chance"].value, finding.evidence["combinations"].value) == (1e-9, 12)
    assert finding.causes[0].startswith("something worn or carried")
    assert finding.causes[-1] == "a prosthesis (prosthesis = true under [segment.tibia_l])"
    assert "joint centre" in unlike(both_sides=True)[0].causes[0]
    assert set(codes(unlike(away=3.5))) == {"R203"}


@pytest.mark.parametrize("added", [True, False])
def test_a_heavier_side_explains_single_parameters_and_the_whole(added):
    side = OneSided(("tibia_r", "calcn_r"), ("tibia_l", "calcn_l"), (0.9, 0.4), 6.2, added)
    (finding,) = unlike(one_sided=side, away=4.5)
    assert finding.code == "R205"
    assert finding.evidence["difference_kg"].value == (0.9, 0.4)
    worn = next(
        k for k, cause in enumerate(finding.causes) if '[[attached]] with segment = "tibia_r" or "calcn_r"' in cause
    )
    artificial = next(k for k, cause in enumerate(finding.causes) if "[segment.tibia_l] and [segment.calcn_l]" in cause)
    assert (worn < artificial) == added


LITERATURE = walking_subject().literature


@pytest.mark.parametrize(
    ("estimated", "stated", "expected"), [(0.96, 1.0, ["S113"]), (0.98, 1.0, []), (1.0, 0.96, ["S113"])]
)
def test_a_total_mass_that_follows_the_plates(estimated, stated, expected):
    mass_kg = LITERATURE.total_mass_kg
    fit = SimpleNamespace(estimate=replace(LITERATURE, mass_kg=estimated * LITERATURE.mass_kg))
    ready = SimpleNamespace(total_mass=TotalMass.of(stated * mass_kg, ()))
    found = list(total_mass(ResultContext(fit, ready)))
    assert [finding.code for finding in found] == expected
    assert all(finding.evidence["estimate_kg"].value == pytest.approx(estimated * mass_kg) for finding in found)


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
    assert [(finding.code, finding.where.part) for finding in found] == [("S407", "rucksack")] * expected
    assert all(finding.evidence["mass_kg"].value == 7.26 for finding in found)
