"""A synthetic walk and four measured ones from the command line, and what must hold on them."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.instrument_errors import GAIN, CalibrationEntry
from kinertia.estimation.simultaneous.markers.skin import OTHER_EXPECTED_SD_M
from kinertia.estimation.simultaneous.observation import FORCE_SD_OF_WEIGHT
from kinertia.io.recording import read_recording
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.settings import Settings, Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate_bsp, light_plates
from kinertia.workflow.person import Person
from recordings import FITTED, slow_beside

walks = pytest.mark.parametrize("name", slow_beside(("synthetic", "gait2354"), FITTED))
LONGEST_WINDOW_S = {
    "synthetic": (1.09, 2.17),
    "gait2354": (0.0, 2.5),
    "rajagopal": (0.43, 1.97),
    "pig_a": (2.70, 3.75),
    "pig_b": (2.88, 3.70),
}
"""Outside these times a foot is on the ground and on no plate (gait2354: the trial ends), or beyond one (pig_b)."""


@walks
def test_inverse_kinematics_follows_the_markers(fit_of, name):
    assert 0.001 < fit_of(name).trial["marker_rms_m"]["ik"] <= 0.015


@walks
def test_correction_and_estimate_lower_the_residual(fit_of, name):
    """The force to what segments are taken to be off rigid ones, half a percent of body weight on each axis; or, where
    heels strike hard, to more: body and instruments do not bend to follow impacts, and root errors grow with the force
    that accelerates the body.
    """
    fit = fit_of(name)
    for quantity in ("residual_force_rms_N", "residual_moment_rms_Nm"):
        residual = fit.trial[quantity]
        assert max(residual["estimate"], residual["corrected"]) < residual["literature"]
    weight = fit.summary["total_mass_kg"]["estimate"] * GRAVITY_M_S2
    impacts = 1.6 if fit.trial["impact_force_rms_N"] > 5.0 else 1.0
    assert fit.trial["residual_force_rms_N"]["estimate"] < impacts * np.sqrt(3.0) * FORCE_SD_OF_WEIGHT * weight
    assert fit.trial["residual_moment_rms_Nm"]["estimate"] < 3.0


@walks
def test_total_mass_is_the_scale_s_or_a_warning_says_why(fit_of, name):
    summary = fit_of(name).summary
    mass = summary["total_mass_kg"]
    assert mass["literature"] == pytest.approx(mass["measured"], rel=1e-6)
    off = abs(mass["estimate"] / mass["measured"] - 1) > 0.03
    assert ("S113" in [finding["code"] for finding in summary["findings"]]) == off


@walks
def test_unmeasured_steps_are_left_out(fit_of, name):
    trial = fit_of(name).trial
    first, last = trial["window_s"]
    earliest, latest = LONGEST_WINDOW_S[name]
    assert earliest <= first < last <= latest
    assert last - first > 0.75 * (latest - earliest)
    assert trial["n_dynamic_frames"] <= trial["n_frames"]
    if name != "gait2354":
        assert trial["n_dynamic_frames"] < 0.7 * trial["n_frames"]


@walks
def test_estimated_motion_stays_near_the_markers(fit_of, name):
    """Nearer than inverse kinematics, since the estimate calibrates where they sit, or farther by what skin moves."""
    markers = fit_of(name).trial["marker_rms_m"]
    skin = np.sqrt(3.0) * OTHER_EXPECTED_SD_M
    assert 0.8 * markers["ik"] < markers["final"] < min(np.hypot(markers["ik"], skin), 0.012)


@walks
def test_time_is_told_for_every_stage(fit_of, name):
    seconds = fit_of(name).trial["seconds"]
    assert {"read", "ik", "estimate", "total"} <= set(seconds)
    assert min(seconds.values()) > 0
    assert seconds["total"] == pytest.approx(sum(v for stage, v in seconds.items() if stage != "total"), abs=1e-3)


@walks
def test_an_impossible_body_is_warned_about(fit_of, name):
    fit = fit_of(name)
    table = np.genfromtxt(fit.folder / "bsp.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    moments = {p: table["estimate"][table["parameter"] == p] for p in ("ixx", "iyy", "izz")}
    largest = np.maximum.reduce(list(moments.values()))
    impossible = int((2 * largest > sum(moments.values())).sum())
    found = [finding["evidence"]["count"]["value"] for finding in fit.summary["findings"] if finding["code"] == "R202"]
    assert found == ([impossible] if impossible else [])


def test_mass_and_height_come_from_the_c3d_file(short_fit):
    assert short_fit.subject.mass_kg == pytest.approx(72.6, abs=0.1)
    assert short_fit.subject.height_m == pytest.approx(1.803, abs=0.001)
    assert "S103" not in [finding.code for finding in short_fit.findings]


def test_several_trials_share_one_body(short_fit):
    early, late = short_fit.trials
    assert (early.name, late.name) == ("early", "late")
    assert early.time[[0, -1]] == pytest.approx([1.2, 1.5], abs=0.011)
    assert late.time[[0, -1]] == pytest.approx([1.7, 2.0], abs=0.011)
    for trial in short_fit.trials:
        frames = len(trial.time)
        assert {stage: values.shape for stage, values in trial.residuals.items()} == dict.fromkeys(
            ("literature", "corrected", "estimate"), (frames, 6)
        )
        assert trial.moments["estimate"].shape == trial.motion.q.shape == (frames, 27)
        assert list(trial.coordinates) == list(trial.moments["estimate"]) == list(short_fit.skeleton.coordinates)
        assert trial.moments["estimate"].index.equals(trial.coordinates.index)
        assert np.isfinite(trial.motion.qdd).all()


def test_root_rows_of_inverse_dynamics_are_the_residual(short_fit):
    """Pelvis translations are along the ground axes, so their loads are the residual force."""
    for trial in short_fit.trials:
        (before, _), (after, _) = (np.hsplit(trial.full_residuals[stage], 2) for stage in ("literature", "estimate"))
        np.testing.assert_allclose(trial.moments["estimate"].iloc[:, :3], after, atol=1e-6)
        # the study's estimator has forces of the motion's bandwidth before, too
        smoothed = trial.moments["literature"].to_numpy()[:, :3] - trial.residuals["literature"][:, :3]
        assert np.abs(smoothed).max() < (0.5 if short_fit.settings.method == "two-level" else 1e-6)
        assert before.shape == after.shape


def test_left_mirrors_right_unless_told_otherwise(short_fit):
    bsp = short_fit.estimate
    index = bsp.segments.index
    mirrored = bsp.com_m[index("thigh_l")] * [1, 1, -1]
    np.testing.assert_allclose(mirrored, bsp.com_m[index("thigh_r")], atol=1e-9)
    assert bsp.mass_kg[index("thigh_l")] == pytest.approx(bsp.mass_kg[index("thigh_r")])


@pytest.mark.usefixtures("few_evaluations")
def test_settings_and_subject_reach_the_result(c3d_lab, short_fit):
    """De Leva's table, 84 parameters, a fixed cutoff, and a mass that the file contradicts."""
    walk, static = (read_recording(c3d_lab / f"{kind}.c3d") for kind in ("walk", "static"))
    shares = []
    fit = estimate_bsp(
        Person(Subject(name="A", sex="male", mass_kg=77.0), [TrialInput(walk, (1.2, 1.45))], static),
        Settings(method="two-level", bsp="deleva", symmetry=False, cutoff_hz=6.0, hip_centre="harrington"),
        lambda stage, share: shares.append((stage, share)),
    )
    assert fit.literature.total_mass_kg == pytest.approx(77.0)
    (found,) = [finding for finding in fit.findings if finding.code == "S103"]
    assert found.severity.name == "WARNING"
    values = [found.evidence[name].value for name in ("quantity", "stated", "filed", "files")]
    assert values == ["mass", 77.0, pytest.approx(72.6, abs=0.1), "static, walk"]
    assert fit.trials[0].kinematics.cutoff_hz == pytest.approx(6.0)
    thighs = [fit.estimate.mass_kg[fit.estimate.segments.index(f"thigh_{side}")] for side in "rl"]
    assert abs(thighs[0] - thighs[1]) > 1e-3
    share = [fit.literature.mass_kg / 77.0, short_fit.literature.mass_kg / short_fit.literature.total_mass_kg]
    assert np.abs(share[0] - share[1]).max() > 0.005
    assert [stage for stage, _ in shares][:2] == ["calibration", "inverse kinematics"]
    assert shares[-1][0] == "estimate"
    assert all(0 <= share <= 1 for _, share in shares)


def gain(plate: str, value: float, sd: float, trial: str | None = "walk") -> CalibrationEntry:
    return CalibrationEntry(
        kind="plate", plate=plate, trial=trial, quantity=GAIN, value=value, prior_sd=0.003, sd=sd, unit="1"
    )


@pytest.mark.parametrize(
    ("gains", "light"),
    [
        ([gain("plate 1", -0.042, 0.010), gain("plate 2", -0.033, 0.006)], set()),  # Plug-in Gait, subject B
        ([gain("plate 1", -0.120, 0.010), gain("plate 2", -0.033, 0.006)], {"plate 1"}),
        ([gain("plate 1", -0.042, 0.010), gain("plate 2", 0.001, 0.006)], {"plate 1"}),
        ([gain("plate 1", -0.042, 0.010)], {"plate 1"}),
        ([gain("plate 1", 0.042, 0.010), gain("plate 2", 0.1, 0.006)], set()),
        (
            [gain("plate 1", -0.042, 0.010), gain("plate 1", 0.0, 0.003, None), gain("plate 2", 0.0, 0.003, None)],
            {"plate 1"},
        ),
    ],
)
def test_a_plate_is_light_where_it_reads_less_than_the_others(gains, light):
    assert light_plates(gains) == light
