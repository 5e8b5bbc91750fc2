"""Verdicts on a fit, with residuals and segments set to what the guideline names."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.verdict import stands_against, verdicts
from kinertia.model.bsp import BodySegmentParameters

FRAMES = 50
BODY = BodySegmentParameters(
    ("pelvis", "thigh_r"), [10.0, 8.0], [[0, 0, 0], [0, -0.2, 0]], [np.eye(3) * 0.1, np.diag([0.15, 0.04, 0.15])]
)


def fit(force_n=0.0, moment_nm=0.0, external_n=800.0, markers_m=0.008, **changes):
    """A fit whose residual has this length throughout; a pair is RMS-filling base and one frame's peak."""
    residual = np.zeros((FRAMES, 6))
    for column, size in ((0, force_n), (4, moment_nm)):
        base, peak = size if isinstance(size, tuple) else (size, size)
        residual[:, column] = base
        residual[7, column] = -peak
    loads = np.zeros((FRAMES, 2, 6))
    loads[:, :, 1] = external_n / 2
    trial = SimpleNamespace(
        name="walk",
        motion_hz=12.0,
        reactions=SimpleNamespace(cutoff_hz=None),
        residuals={"estimate": residual},
        full_residuals={"estimate": 3.0 * residual},
        kinematics=SimpleNamespace(foot_loads=loads),
        marker_errors_m={"final": np.full((FRAMES, 3), markers_m)},
    )
    given = {
        "converged": True,
        "estimate": BODY,
        "literature": BODY,
        "posterior": None,
        "trials": (trial,),
        "file": None,
        "skeleton": SimpleNamespace(locked={}),
        "expected": changes.get("literature", BODY),
        "more_known": False,
    }
    return SimpleNamespace(**{**given, **changes})


def level(judged, start):
    (verdict,) = [one for one in judged if one.sentence.startswith(start)]
    return verdict.level


def test_a_good_fit_passes_every_check():
    judged = verdicts(fit(4.0, 20.0))
    assert {one.level for one in judged} == {"pass"}
    assert not stands_against(judged)


@pytest.mark.parametrize(
    ("force", "expected"),
    [(5.0, "pass"), (5.1, "caution"), (10.0, "caution"), (10.1, "fail"), ((3.0, 9.9), "pass"), ((3.0, 10.1), "caution"),
     ((3.0, 25.0), "caution"), ((3.0, 25.1), "fail")],
)  # fmt: skip
def test_force_by_the_guideline(force, expected):
    judged = verdicts(fit(force))
    assert level(judged, "walk: residual force") == expected
    assert stands_against(judged) == (expected == "fail")


def test_residuals_are_judged_at_the_motions_bandwidth_and_told_at_both():
    """Three times as much at full bandwidth changes no level."""
    for start, expected, full in (
        (
            "walk: residual force",
            "RMS 4.0 N, peak 4.0 N: well within OpenSim's guideline (at most 5 and 10 N)",
            "RMS 12.0 N",
        ),
        (
            "walk: residual moment",
            "RMS 20.0 N m, peak 20.0 N m: well within OpenSim's guideline (at most 30 and 50 N m)",
            "RMS 60.0 N m",
        ),
    ):
        (sentence,) = [one.sentence for one in verdicts(fit(4.0, 20.0)) if one.sentence.startswith(start)]
        assert sentence.startswith(f"{start} at the motion's bandwidth (12 Hz) {expected}")
        assert sentence.endswith(f"with forces at full bandwidth {full}")


@pytest.mark.parametrize(("markers_m", "expected"), [(0.012, "pass"), (0.013, "caution"), (0.021, "fail")])
def test_markers_by_the_guideline(markers_m, expected):
    start = "walk: model and measured markers"
    assert level(verdicts(fit(markers_m=markers_m)), start) == expected
    of_model = verdicts(fit(markers_m=markers_m, file=object()))
    (sentence,) = [one.sentence for one in of_model if one.sentence.startswith(start)]
    assert ("--calibrate" in sentence) == (expected == "fail")


def test_nobody_is_told_to_let_move_what_moves_already_or_is_grossly_wrong():
    """What moves hides a model that is another person's."""
    moved = {f"hip_r/offset_{axis}": 0.01 for axis in "xyz"}
    for given in ({"markers_m": 0.05}, {"markers_m": 0.03, "skeleton": SimpleNamespace(locked=moved)}):
        of_model = verdicts(fit(file=object(), **given))
        (sentence,) = [one.sentence for one in of_model if one.sentence.startswith("walk: model and measured markers")]
        assert "--calibrate" not in sentence
        assert "was scaled to this person" in sentence


@pytest.mark.parametrize(
    ("moment", "expected"),
    [
        (30.0, "pass"),
        (30.1, "caution"),
        (50.0, "caution"),
        (50.1, "fail"),
        ((9.0, 50.1), "caution"),
        ((9.0, 75.1), "fail"),
    ],
)
def test_moment_by_the_guideline(moment, expected):
    assert level(verdicts(fit(0.0, moment)), "walk: residual moment") == expected


def test_five_percent_of_the_external_force():
    """A child of 20 kg: 12 N are within OpenSim's newtons, and too much for 200 N."""
    judged = verdicts(fit((3.0, 12.0), external_n=200.0))
    assert level(judged, "walk: residual force") == "caution"
    assert level(judged, "walk: the peak residual force is 6.0 % of") == "fail"


def test_not_converged():
    judged = verdicts(fit(converged=False))
    assert level(judged, "the estimate did not converge") == "fail"


def test_impossible_segments_are_named_and_bodies_without_mass_are_not():
    table = BODY.table()
    table[1, 4:7] = 0.1, 0.5, 0.1
    wrong = BodySegmentParameters.from_table((*BODY.segments, "patella_r"), np.vstack([table, np.zeros(10)]))
    judged = verdicts(fit(estimate=wrong, literature=wrong))
    assert level(judged, "physically impossible segments: 1 of 3 (thigh_r)") == "fail"


def test_light_bodies_that_were_kept_as_a_model_has_them_condemn_nothing():
    """The toes of LaiArnold's model, 0.2 kg, have moments of inertia that no body has."""
    toes = np.array([[0.2, 0.03, 0.0, 0.0, 1e-4, 1e-3, 1e-5, 0, 0, 0]])
    body = BodySegmentParameters.from_table((*BODY.segments, "toes_r"), np.vstack([BODY.table(), toes]))
    deviations = np.vstack([np.ones_like(BODY.table()), np.zeros(10)])
    posterior = SimpleNamespace(prior_sd=deviations, sd=0.5 * deviations)
    judged = verdicts(fit(estimate=body, literature=body, expected=body, posterior=posterior))
    assert level(judged, "physically impossible in the model, and kept as they are: toes_r") == "caution"
    assert not stands_against(judged)


def test_a_body_without_thickness_is_let_pass():
    """The toes of OpenSim's gait2354: 0.0001 + 0.0001 = 0.0002, but not in binary."""
    toes = np.array([[0.2166, 0.0346, 0.006, -0.0175, 0.0001, 0.0002, 0.0001, 0, 0, 0]])
    flat = BodySegmentParameters.from_table((*BODY.segments, "toes_r"), np.vstack([BODY.table(), toes]))
    assert not flat.physically_consistent().all()
    assert not stands_against(verdicts(fit(estimate=flat, literature=flat)))


def test_centre_of_mass_far_from_the_literature():
    moved = replace(BODY, com_m=BODY.com_m + np.array([[0.0], [0.12]]) * [0, 1, 0])
    judged = verdicts(fit(estimate=moved))
    assert level(judged, "1 centre of mass lies more than 100 mm from the literature (farthest: thigh_r, 120") == "fail"
    near = replace(BODY, com_m=BODY.com_m + np.array([[0.0], [0.09]]) * [0, 1, 0])
    assert not stands_against(verdicts(fit(estimate=near)))


@pytest.mark.parametrize(("away", "expected"), [(2.9, "pass"), (-3.1, "caution"), (3.9, "caution"), (-4.1, "fail")])
def test_parameters_by_prior_deviations(away, expected):
    sd = np.full((2, 10), 0.01)
    estimate = BodySegmentParameters.from_table(BODY.segments, BODY.table() + np.eye(2, 10) * away * 0.01)
    judged = verdicts(fit(estimate=estimate, posterior=SimpleNamespace(prior_sd=sd)))
    (verdict,) = [one for one in judged if "3 prior SDs from" in one.sentence]
    assert verdict.level == expected
    assert "mass of pelvis" in verdict.sentence or "com_x of thigh_r" in verdict.sentence


def test_who_is_as_was_said_is_not_far_from_the_prior_for_being_unlike_the_literature():
    measured = BodySegmentParameters.from_table(BODY.segments, BODY.table() + 0.05 * np.eye(2, 10))
    posterior = SimpleNamespace(prior_sd=np.full((2, 10), 0.01))
    (verdict,) = [
        one
        for one in verdicts(fit(estimate=measured, expected=measured, more_known=True, posterior=posterior))
        if "3 prior SDs from" in one.sentence
    ]
    assert verdict.level == "pass"
    assert "from the prior (" in verdict.sentence


@pytest.mark.parametrize(("doubted", "expected"), [(1, "caution"), (2, "caution"), (3, "fail")])
def test_more_than_two_doubted_segments_contradict_the_model(doubted, expected):
    """Several parameters of one segment go together and count once."""
    segments = ("pelvis", "thigh_r", "thigh_l", "torso")
    table = np.tile(BODY.table()[:1], (4, 1))
    away = table.copy()
    away[:doubted, :3] += 0.031
    before, after = (BodySegmentParameters.from_table(segments, one) for one in (table, away))
    posterior = SimpleNamespace(prior_sd=np.full((4, 10), 0.01))
    judged = verdicts(fit(literature=before, estimate=after, posterior=posterior))
    (verdict,) = [one for one in judged if "3 prior SDs from" in one.sentence]
    assert verdict.level == expected
    assert ("take pelvis" in verdict.sentence) == (expected == "caution")
