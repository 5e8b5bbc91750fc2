"""Which sign of the free moments the whole estimate finds likelier, on synthetic walks."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from command_line import fitted
from kinertia.estimation import free_moment_sign
from kinertia.estimation.free_moment_sign import with_likelier_sign
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.fit import fit_simultaneous
from kinertia.estimation.simultaneous.instruments.instrument_errors import CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.uncertainty.evidence import Evidence, FreeMomentSign
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.synthetic.laboratory import camera_noise
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.ground_contact import free_moment
from recordings import slow_beside
from results import entry_of
from validation.synthetic_walks import kinematics_of


@dataclass(frozen=True)
class Person:
    """What `with_likelier_sign` needs of a prepared one."""

    skeleton: Skeleton
    literature: BodySegmentParameters
    kinematics: tuple[Kinematics, ...]
    uncertainty: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(instruments=InstrumentPrior()))


@pytest.fixture(scope="module")
def trial():
    return walk(walking_subject(), 0.9, trapezoid=False)


def person(trial, *factors, offset=0.0, noise_m=0.003):
    """With one walk for each factor: free moments times it, and an offset of the left plate's in N m/N."""
    kinematics = []
    for seed, factor in enumerate(factors, start=100):
        loads = trial.foot_loads.copy()
        carried = loads[..., 1] > 20.0
        loads[..., 4] += np.where(carried, (factor - 1.0) * free_moment(loads), 0.0)
        loads[:, 1, 4] += offset * loads[:, 1, 1]
        markers = camera_noise(trial.markers, noise_m, np.random.default_rng(seed))
        solved = kinematics_of(trial, markers, loads)
        kinematics.append(replace(solved, trial=replace(solved.trial, name=f"walk {seed}")))
    return Person(trial.skeleton, walking_subject().literature, tuple(kinematics))


@dataclass(frozen=True)
class Posterior:
    """What of it has to do with the sign."""

    free_moment_sign: FreeMomentSign | None = None
    instrument_errors: tuple[CalibrationEntry, ...] = ()


@dataclass(frozen=True)
class Fitted:
    """An estimate with its evidence alone."""

    result: SimpleNamespace
    posterior: Posterior = Posterior()


def sign_of(outcome):
    """What was found of the sign."""
    return outcome.fitted.posterior.free_moment_sign


def signed(ready):
    """The outcome, and how many estimates it took."""
    fits = []

    def fit(prepared: Person, otherwise: Sequence[Kinematics]):
        fits.append(prepared)
        prior = literature_prior(prepared.literature)
        return fit_simultaneous(prepared.skeleton, prior, prepared.kinematics, otherwise=otherwise)

    with threadpool_limits(1, user_api="blas"):
        return with_likelier_sign(ready, fit), len(fits)


OFFSETS = slow_beside([0.006], [0.0, 0.006, -0.006])


@pytest.fixture(scope="module")
def turned(trial):
    """A person whose free moments have the wrong sign, and the outcome, by the offset."""

    @cache
    def get(offset):
        ready = person(trial, -1.0, offset=offset)
        return ready, signed(ready)[0]

    return get


@pytest.mark.parametrize("offset", OFFSETS)
def test_a_right_sign_stays_and_takes_one_estimate(trial, offset):
    ready = person(trial, 1.0, offset=offset)
    outcome, fits = signed(ready)
    assert fits == 1
    assert outcome.ready is ready
    sign = sign_of(outcome)
    assert sign is None or not (sign.wrong or sign.open)


@pytest.mark.parametrize("offset", OFFSETS)
def test_a_wrong_sign_is_turned(turned, offset):
    ready, outcome = turned(offset)
    assert sign_of(outcome).wrong
    (given,), (used,) = ready.kinematics, outcome.ready.kinematics
    free, turned = (free_moment(k.trial.loads.wrench) for k in (given, used))
    carried = given.trial.loads.force[..., 1] >= 20.0
    np.testing.assert_allclose(turned[carried], -free[carried], atol=1e-9)
    np.testing.assert_array_equal(used.trial.loads.force, given.trial.loads.force)
    entry = entry_of(outcome.fitted, "free moment", plate="left foot")
    assert entry.value == pytest.approx(-offset, abs=0.002)


@pytest.mark.slow
def test_trials_say_it_together(trial, turned):
    alone, together = (
        sign_of(outcome) for outcome in (turned(0.006)[1], signed(person(trial, -1.0, -1.0, offset=0.006))[0])
    )
    assert together.wrong
    assert together.log_odds > alone.log_odds


@pytest.mark.parametrize("factor", [0.0, -0.02])
def test_without_free_moments_nothing_is_asked(trial, factor):
    outcome, fits = signed(person(trial, factor))
    assert fits == 1
    assert sign_of(outcome) is None


@pytest.mark.parametrize("found", [1.0, -1.0])
def test_trials_that_cannot_tell_leave_it_open(trial, found, monkeypatch):
    """Estimates with hardly any difference between the signs, whatever was predicted; the turned one comes first."""
    monkeypatch.setattr(free_moment_sign, "compared_with", lambda fitted, other: fitted)
    ready, evidence = person(trial, -1.0), iter([Evidence(0.0, 30.0), Evidence(found, None)])
    outcome = with_likelier_sign(ready, lambda *_: Fitted(SimpleNamespace(evidence=next(evidence))))
    assert outcome.ready is ready
    assert outcome.fitted.result.evidence.found == found
    assert sign_of(outcome).log_odds == -found
    assert sign_of(outcome).open


@pytest.mark.parametrize("found", [30.0, -30.0])
def test_where_the_first_estimate_leaves_it_open_the_second_decides(trial, found):
    ready, evidence = person(trial, -1.0), iter([Evidence(0.0, 1.0), Evidence(found, None)])
    outcome = with_likelier_sign(ready, lambda *_: Fitted(SimpleNamespace(evidence=next(evidence))))
    assert sign_of(outcome).wrong is (found < 0.0)
    assert (outcome.ready is ready) is (found > 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "corrected"), [("walking1", True), ("walkingTO1", True), ("DJ1", False), ("static1", False)]
)
def test_files_whose_sign_is_wrong(measured_folder, tmp_path, name, corrected):
    """All of one public data set, of which a jump and a person who stands show nothing."""
    lab = measured_folder / "subject4"
    files = {
        "forces": f"{name}_grf.mot",
        "loads": f"{name}_external_forces.xml",
        "model": "addbiomechanics_scaled.osim",
    }
    options = [word for option, file in files.items() for word in (f"--{option}", lab / file)]
    fit = fitted(tmp_path / "out", lab / f"{name}.trc", *options, "--calibrate", "--mass", "62.6").summary
    codes = [finding["code"] for finding in fit["findings"]]
    assert codes.count("P269") == int(corrected)
    assert "P265" not in codes
    free = [entry["value"] for entry in fit["calibration"] if entry["quantity"] == "free moment"]
    assert np.abs(free).max() < 0.003


@pytest.mark.slow
@pytest.mark.parametrize("name", ["run200", "run300"])
def test_files_whose_sign_is_right(measured_folder, tmp_path, name):
    lab = measured_folder / "field" / "hamner_treadmill_run"
    options = ["--forces", lab / f"{name}_grf.mot", "--model", lab / "final.osim", "--mass", "72.84", "--calibrate"]
    fit = fitted(tmp_path / "out", lab / f"{name}.trc", *options).summary
    assert "P269" not in [finding["code"] for finding in fit["findings"]]


@pytest.mark.parametrize(
    ("log_odds", "wrong", "left_open"),
    [(59.0, True, False), (5.2, True, False), (1.0, False, True), (-20.0, False, False)],
)
def test_how_sure_one_must_be(log_odds, wrong, left_open):
    sign = FreeMomentSign(log_odds, 2.0)
    assert (sign.wrong, sign.open) == (wrong, left_open)
