"""Norms of a laboratory's own people, and how far a gait is from them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from kinertia.errors import KinertiaError
from kinertia.estimation.result.gait_scores import variable_score, with_norms
from kinertia.estimation.result.mean_cycles import (
    Control,
    band_columns,
    convention_of,
    gait_profile,
    mean_curves,
    mixture,
    remarks,
)
from kinertia.io.norms_file import Norm
from kinertia.model.skeleton import opposite_on_left
from kinertia.motion.gait_cycle import PERCENT, feet_under_pelvis
from kinertia.motion.model_outputs import CLINICAL_ANGLES

OFFSETS = dict(zip(CLINICAL_ANGLES, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0), strict=True))


@pytest.fixture(scope="module")
def curves(fit):
    return mean_curves(fit)


@pytest.fixture(scope="module")
def sides(fit, curves):
    """Which sides have a stride."""
    return {side for _, side in curves}


def norms_of(curves, side, convention="", people=None):
    """A norm from which each variable of a side is off by its offset all the time."""
    return {
        name: Norm(PERCENT.astype(float), curves[name, side] + offset, np.ones(101), people, convention)
        for name, offset in OFFSETS.items()
    }


def test_scores_are_root_mean_squares(fit, curves, sides):
    side = min(sides)
    profile = gait_profile(fit, norms_of(curves, side, convention_of(fit), people=12))
    for name, offset in OFFSETS.items():
        assert profile.gvs_deg[name, side] == pytest.approx(offset)
    assert profile.gps_deg[side] == pytest.approx(np.sqrt(np.mean(np.square(list(OFFSETS.values())))))
    assert profile.norm_people == 12
    table = profile.table
    assert len(table) == 21
    assert table[(table.score == "GPS") & (table.side == side)].degrees.item() == profile.gps_deg[side]


def test_the_overall_score_has_the_pelvis_once_from_the_left(fit, curves, monkeypatch):
    """Fifteen scores: three of the pelvis in the left side's cycle, six of each side."""
    flat = {name: np.zeros(101) for name in CLINICAL_ANGLES}
    both = {(name, side): value for name, value in flat.items() for side in "rl"}
    both |= {(name, "l"): np.full(101, 3.0) for name in list(CLINICAL_ANGLES)[:3]}
    both |= {(name, "r"): np.full(101, 100.0) for name in list(CLINICAL_ANGLES)[:3]}
    both["knee_flexion_clinical", "r"] = np.full(101, 6.0)
    monkeypatch.setattr("kinertia.estimation.result.mean_cycles.mean_curves", lambda fit: both)
    zero = {name: Norm(np.array([0.0, 100.0]), np.zeros(2), np.ones(2)) for name in CLINICAL_ANGLES}
    profile = gait_profile(fit, zero)
    assert profile.overall_deg == pytest.approx(np.sqrt((3 * 3.0**2 + 6.0**2) / 15))
    assert profile.gps_deg["l"] == pytest.approx(np.sqrt(3 * 3.0**2 / 9))


def test_a_curve_that_is_not_known_has_no_score(fit, curves, sides):
    norm = Norm(PERCENT.astype(float), np.zeros(101), np.ones(101))
    part = np.where(PERCENT < 80, 1.0, np.nan)
    assert np.isnan(variable_score(part, norm))
    assert variable_score(np.where(PERCENT < 98, 2.0, np.nan), norm) == pytest.approx(2.0)
    if len(sides) == 1:
        (side,) = sides
        profile = gait_profile(fit, norms_of(curves, side))
        assert np.isnan(profile.overall_deg), "one side alone is no score of both"


def test_norms_of_another_convention_are_refused(fit, curves, sides):
    norms = norms_of(curves, min(sides), "Plug-in Gait")
    with pytest.raises(KinertiaError, match="the norms are of Plug-in Gait, this fit is of Kinertia gait27"):
        gait_profile(fit, norms)
    del norms["ankle_dorsiflexion_clinical"]
    with pytest.raises(KinertiaError, match="lack ankle dorsiflexion"):
        gait_profile(fit, {name: replace(norm, convention="") for name, norm in norms.items()})


def test_what_is_opposite_on_the_left_is_known(fit):
    expected = {"pelvis_list", "pelvis_rotation", "lumbar_bending", "lumbar_rotation"}
    assert opposite_on_left(fit.skeleton) == expected


def test_foot_progression_follows_heel_and_toe_markers(fit, curves, sides):
    """But for how the markers sit on the foot, which is constant."""
    (trial,) = fit.trials
    feet = feet_under_pelvis(trial.skeleton, trial.kinematics)
    for side in sides:
        stride = next(candidate for candidate in trial.strides if candidate.side == side)
        rows = np.searchsorted(feet.time, stride.time[5:50])
        along = (feet.toe[side] - feet.heel[side])[rows]
        markers = np.degrees(np.arctan2(-along[:, 2], along[:, 0])) * (1.0 if side == "r" else -1.0)
        gap = curves["foot_progression_clinical", side][5:50] - markers
        assert gap.std() < 2.0
        assert abs(gap.mean()) < 15.0


def test_clinical_angles_are_the_coordinates_with_other_signs(fit, curves, sides):
    """Against an oracle that is independent of the model's poses: the coordinates of inverse kinematics."""
    cycles = fit.cycles("literature")
    for side in sides:
        rows = cycles[(cycles.side == side) & (cycles.stride == 1)].pivot(
            index="percent", columns="quantity", values="value"
        )
        mirrored = 1.0 if side == "r" else -1.0
        for ours, coordinate, sign in (
            ("pelvis_tilt", "pelvis_tilt", -1.0),
            ("pelvis_obliquity", "pelvis_list", -mirrored),
            ("hip_flexion", "hip_flexion", 1.0),
            ("hip_adduction", "hip_adduction", 1.0),
            ("hip_rotation", "hip_rotation", 1.0),
        ):
            gap = rows[f"{ours}_clinical"] - sign * rows[f"{coordinate}_angle"]
            assert gap.abs().max() < (1e-6 if ours.startswith("hip") else 1.0), ours
        for ours, coordinate, least in (
            ("knee_flexion", "knee_angle", 0.99),
            ("ankle_dorsiflexion", "ankle_angle", 0.9),
        ):
            # the foot turns about the subtalar axis as well, which is oblique
            assert np.corrcoef(rows[f"{ours}_clinical"], rows[f"{coordinate}_angle"])[0, 1] > least


def test_scores_of_each_stride_stand_in_the_table_of_cycles(fit, sides):
    side = min(sides)
    rows = fit.cycles()
    columns = {name: rows[name].tolist() for name in rows}
    level = Norm(np.array([0.0, 100.0]), np.zeros(2), np.ones(2), 3, convention_of(fit))
    table = pd.DataFrame(
        with_norms(columns, dict.fromkeys([*CLINICAL_ANGLES, "pelvis_list_angle"], level), fit.skeleton)
    )
    stride = table[(table.side == side) & (table.stride == 1)]
    squares = []
    for quantity in CLINICAL_ANGLES:
        of_quantity = stride[stride.quantity == quantity]
        squares.append(np.square(of_quantity.value).mean())
        np.testing.assert_allclose(of_quantity.gvs, np.sqrt(squares[-1]))
    np.testing.assert_allclose(stride.gps.dropna(), np.sqrt(np.mean(squares)))
    assert table[table.quantity == "knee_angle_moment"].norm.isna().all()


def test_norms_of_other_people_are_said_to_be(fit):
    def said(age, **norm):
        person = replace(fit, subject=fit.subject.model_copy(update={"age_years": age}))
        angle_norm = Norm(np.zeros(1), np.zeros(1), np.zeros(1), 4, "Kinertia gait27", **norm)
        return " ".join(remarks(person, angle_norm))

    assert said(35.0, age_years=(20.0, 40.0), speed_m_s=(0.1, 9.0)) == ""
    assert "35 years old, people in the norms 7 to 11" in said(35.0, age_years=(7.0, 11.0))
    assert "mix children and adults (7 to 40 years)" in said(35.0, age_years=(7.0, 40.0))
    assert "Age of the norms is not stated" in said(35.0)
    assert "Age of this person is not stated" in said(None, age_years=(7.0, 11.0))
    assert "m/s, people in the norms at 0.20 to 0.30" in said(35.0, age_years=(20.0, 40.0), speed_m_s=(0.2, 0.3))
    stated = Norm(np.zeros(1), np.zeros(1), np.zeros(1))
    assert "no convention" in " ".join(remarks(fit, stated))


def control(name, offset, age=None, speed=1.2, convention="Kinertia gait27", known=101):
    curve = np.where(np.arange(101) < known, 10.0 + offset, np.nan)
    return Control(name, {"knee_angle_angle": curve}, age, speed, convention)


def test_bands_are_mean_and_spread_between_people():
    people = [control("a", -1.0, 20.0, 1.1), control("b", 1.0, 31.0), control("c", 3.0, None, np.nan, known=60)]
    columns = band_columns(people)
    assert columns["percent"] == list(range(101))
    assert (columns["mean"][0], columns["sd"][0], columns["n"][0]) == pytest.approx((11.0, 2.0, 3))
    assert (columns["mean"][99], columns["n"][99]) == (10.0, 2)
    spans = [columns[f"{name}_{end}"][0] for name in ("age_years", "speed_m_s") for end in ("min", "max")]
    assert spans == [20.0, 31.0, 1.1, 1.2]
    assert set(columns["convention"]) == {"Kinertia gait27"}


def test_bands_need_people_of_one_convention():
    with pytest.raises(KinertiaError, match="at least 2 different people"):
        band_columns([control("a", 0.0)])
    with pytest.raises(KinertiaError, match="different models"):
        band_columns([control("a", 0.0), control("b", 0.0, convention="OpenSim model")])


def test_children_among_adults_are_said():
    assert mixture([control("a", 0.0, 20.0), control("b", 0.0, 31.0)]) == ""
    assert "1 children and 1 adults" in mixture([control("a", 0.0, 9.0), control("b", 0.0, 31.0)])
    assert "age of 1 of 2 people not stated" in mixture([control("a", 0.0), control("b", 0.0, 31.0)])


def test_without_strides_nobody_is_a_control(fit):
    still = replace(fit, trials=tuple(replace(trial) for trial in fit.trials))
    for trial in still.trials:
        trial.__dict__["strides"] = ()
    with pytest.raises(KinertiaError, match="no strides"):
        Control.of(still)
