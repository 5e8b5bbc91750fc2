"""Peaks and impulses of joint moments: whole, or not at all."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.result.cycles import LANDING_PEAKS, PEAKS, CycleCurve, peak_columns
from kinertia.motion.gait_cycle import PERCENT, Stride
from kinertia.report.pages.cycle_view import peak_rows

STRIDE = Stride("r", 1, 0.0, 1.0, 0.6, 0.1, 0.5, True)
FIRST, SECOND, IMPULSE = (peak.name for peak in PEAKS[:3])


def adduction(known=PERCENT >= 0):
    """Internal moment with two humps in stance: externally 0.5 at 15 % and 0.3 N m/kg at 45 %."""
    humps = [0.5 * np.exp(-(((PERCENT - 15) / 6) ** 2)), 0.3 * np.exp(-(((PERCENT - 45) / 6) ** 2))]
    value = np.where(known, -sum(humps), np.nan)
    return CycleCurve(
        "walk", STRIDE, "joint_moment", "knee_adduction_joint_moment", value, np.where(known, 0.05, np.nan)
    )


def found(curve):
    columns = peak_columns([curve])
    rows = zip(columns["peak"], columns["value"], columns["sd"], columns["percent"], strict=True)
    return {name: tuple(row) for name, *row in rows}


def test_both_peaks_of_the_external_moment_and_its_impulse():
    peaks = found(adduction())
    assert peaks[FIRST] == pytest.approx((0.5, 0.05, 15.0), abs=1e-3)
    assert peaks[SECOND] == pytest.approx((0.3, 0.05, 45.0), abs=1e-3)
    value, sd, _ = peaks[IMPULSE]
    assert value == pytest.approx(0.8 * 6 * np.sqrt(np.pi) / 100, rel=0.02)  # a stride lasts a second
    assert sd == pytest.approx(0.05 * 0.61, rel=0.01)
    assert set(peaks) == {FIRST, SECOND, IMPULSE}, "nothing of curves that are not there"


@pytest.mark.parametrize(("first", "last", "missing"), [(25, 100, {FIRST, IMPULSE}), (0, 50, {SECOND, IMPULSE})])
def test_the_largest_value_of_a_part_is_no_peak(first, last, missing):
    peaks = found(adduction((first <= PERCENT) & (last >= PERCENT)))
    assert {name for name, (value, _, _) in peaks.items() if np.isnan(value)} == missing


def test_a_stance_has_its_peaks_though_no_heel_strike_follows():
    """The same moments over 0.6 s of stance: peaks at other percentages, the same impulse; nothing of swing."""
    curve = adduction()
    at = np.interp(PERCENT, [0, 100], [0, 60])
    stance = replace(
        curve,
        stride=replace(STRIDE, end_s=0.6, toe_off_s=0.6, phase="stance"),
        value=np.interp(at, PERCENT, curve.value),
    )
    whole, peaks = found(curve), found(stance)
    assert peaks[FIRST] == pytest.approx((0.5, 0.05, 25.0), abs=1e-2)
    assert peaks[SECOND] == pytest.approx((0.3, 0.05, 75.0), abs=1e-2)
    assert peaks[IMPULSE][0] == pytest.approx(whole[IMPULSE][0], rel=0.02)
    swing = replace(stance, kind="power", quantity="hip_flexion_power")
    assert np.isnan(found(swing)["hip flexion power, generated, pull-off"][0])


def test_a_landing_has_peaks_of_its_own():
    landing = replace(adduction(), stride=replace(STRIDE, end_s=0.2, toe_off_s=0.2, phase="landing"), task="landing")
    peaks = found(landing)
    assert set(peaks) == {"knee adduction moment, external, landing", "knee abduction moment, external, landing"}
    assert set(peaks) <= {peak.name for peak in LANDING_PEAKS}
    assert peaks["knee adduction moment, external, landing"] == pytest.approx((0.5, 0.05, 15.0), abs=1e-3)
    columns = peak_columns([landing])
    assert set(columns["task"]) == set(columns["phase"]) == {"landing"}


def test_peaks_of_a_fit(fit, two_level):
    first = fit.peaks[fit.peaks.peak == FIRST]
    known = first[first.value.notna()]
    assert set(known.side) == {"r", "l"}
    assert set(known[known.side == "l"].phase) == {"stance"}, "no heel strike follows the left stance on a plate"
    assert (known.value.between(0.0, 1.0) & (known.sd > 0.0)).all()
    assert two_level.peaks.empty
    rows = {row.measure: row for row in peak_rows(fit.curves["estimate"])}
    right = known[known.side == "r"]
    assert rows[f"{FIRST} (N m/kg)"].right.split(" ± ")[0] == f"{right.value.mean():.2f}"
    assert len(rows) == len(PEAKS)
