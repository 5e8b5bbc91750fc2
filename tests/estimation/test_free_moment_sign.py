"""The sign of the plates' free moments against the motion."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.result.plate_errors import reversed_sign
from kinertia.estimation.free_moment_sign import (
    VERTICAL,
    residual_moments_nm,
    residual_moments_without_offsets_nm,
    with_undisputed_plates,
)
from kinertia.estimation.simultaneous.instruments.instrument_errors import (
    ANOTHER_TRIAL,
    OTHER_SIGN,
    POSITION,
    CalibrationEntry,
)
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.motion.dynamics import residual
from kinertia.trial.ground_contact import held_centre_of_pressure


def turned(fit, factor=-1.0):
    """The first trial with these free moments: the sign turned, or none."""
    trial = fit.trials[0]
    kinematics, loads = trial.kinematics, trial.kinematics.trial.loads
    moment = loads.moment.copy()
    for foot in range(2):
        carried = np.cross(held_centre_of_pressure(loads.wrench[:, foot]), loads.force[:, foot])
        free = loads.moment[:, foot, 1] - carried[:, 1]
        moment[:, foot, 1] += (factor - 1.0) * np.where(loads.force[:, foot, 1] > 20.0, free, 0.0)
    kinematics = replace(kinematics, trial=replace(kinematics.trial, loads=replace(loads, moment=moment)))
    left = residual(fit.skeleton, fit.literature, kinematics.motion, kinematics.foot_loads.sum(axis=1))
    return replace(trial, kinematics=kinematics, residuals={**trial.residuals, "literature": left})


def left_by(trial):
    return residual_moments_nm(trial.residuals["literature"][:, VERTICAL], trial.kinematics.foot_loads)


@pytest.fixture(params=["demo", pytest.param("measured", marks=pytest.mark.measured)])
def of_walk(request, fit):
    """The fits of the package's walks."""
    return fit if request.param == "demo" else request.getfixturevalue("measured_demo").fit


def test_a_sound_sign_is_not_doubted(of_walk):
    as_is, otherwise = left_by(of_walk.trials[0])
    assert otherwise > 1.1 * as_is
    assert not list(reversed_sign(of_walk.trials[0]))


def test_a_wrong_sign_is_named(of_walk):
    trial = turned(of_walk)
    (found,) = reversed_sign(trial)
    assert (found.code, found.where.trial) == ("P265", trial.name)
    as_is, otherwise = left_by(trial)
    assert (found.evidence["rms_nm"].value, found.evidence["reversed"].value) == (as_is, otherwise)
    # not the same to the letter: below FIRM_LOAD_N free moments do not count
    assert otherwise == pytest.approx(left_by(of_walk.trials[0])[0], rel=0.2)
    assert as_is > otherwise


def test_without_free_moments_there_is_no_sign(of_walk):
    as_is, otherwise = left_by(turned(of_walk, 0.0))
    assert as_is == otherwise


def test_an_offset_under_one_foot_is_no_wrong_sign():
    """What changes under the foot has the right sign; turned, the offset would go with the motion."""
    phase = np.linspace(0.0, 2.0 * np.pi, 100)
    loads = np.zeros((200, 2, 6))
    loads[:100, 0, 1] = loads[100:, 1, 1] = 700.0
    loads[:100, 0, 4] = 3.0 + 0.5 * np.sin(phase)
    left = np.concatenate([np.full(100, -6.0), np.zeros(100)])
    as_is, turned_nm = residual_moments_nm(left, loads)
    assert turned_nm < 0.8 * as_is
    as_is, turned_nm = residual_moments_without_offsets_nm(left, loads)
    assert as_is < 1e-9 < 0.3 < turned_nm


@pytest.mark.parametrize(("said_by", "disputed"), [(OTHER_SIGN, True), (ANOTHER_TRIAL, False), (None, False)])
def test_a_plate_that_only_one_of_both_signs_displaces_stays(said_by, disputed):
    """Its position keeps the deviation of all plates, and its errors count among the bars."""
    prior = InstrumentPrior()
    error = CalibrationEntry(
        kind="plate",
        plate="left",
        quantity=POSITION,
        axis="x",
        value=-0.026,
        prior_sd=0.0036,
        sd=0.009,
        unit="m",
        contradicted_by=said_by,
    )
    known = with_undisputed_plates(prior, [error])
    assert (known is not prior) == disputed
    assert known.plate["x"].fault_probability == (0.0 if disputed else prior.plate["x"].fault_probability)
    assert known.plate["x"].sd == pytest.approx(prior.plate["x"].sd)
    assert known.plate["z"] == prior.plate["z"]
