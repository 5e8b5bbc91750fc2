"""The sign of the plates' free moments against the motion."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.free_moment_sign import free_moment_sign_warnings, left_moments_nm
from kinertia.trial.centre_of_pressure import held_centre_of_pressure


def turned(kinematics, factor=-1.0):
    """With these free moments: the sign turned, or none."""
    loads = kinematics.trial.loads
    moment = loads.moment.copy()
    for foot in range(2):
        carried = np.cross(held_centre_of_pressure(loads.wrench[:, foot]), loads.force[:, foot])
        free = loads.moment[:, foot, 1] - carried[:, 1]
        moment[:, foot, 1] += (factor - 1.0) * np.where(loads.force[:, foot, 1] > 20.0, free, 0.0)
    return replace(kinematics, trial=replace(kinematics.trial, loads=replace(loads, moment=moment)))


@pytest.fixture(params=["demo", "measured"])
def walk(request, fit):
    """Skeleton, literature and kinematics of the package's walks."""
    of = fit if request.param == "demo" else request.getfixturevalue("measured_demo").fit
    return of.skeleton, of.literature, of.trials[0].kinematics


def test_a_sound_sign_is_not_doubted(walk):
    *body, kinematics = walk
    as_is, otherwise = left_moments_nm(*body, kinematics)
    assert otherwise > 1.1 * as_is
    assert not list(free_moment_sign_warnings(*body, [kinematics]))


def test_a_wrong_sign_is_named(walk):
    *body, kinematics = walk
    (sentence,) = free_moment_sign_warnings(*body, [turned(kinematics)])
    assert sentence.startswith(f"{kinematics.trial.name}: the plates' free moments")
    assert "seem to have the wrong sign" in sentence
    as_is, otherwise = left_moments_nm(*body, turned(kinematics))
    # not the same to the letter: below FIRM_LOAD_N free moments do not count
    assert otherwise == pytest.approx(left_moments_nm(*body, kinematics)[0], rel=0.2)
    assert as_is > otherwise


def test_without_free_moments_there_is_no_sign(walk):
    *body, kinematics = walk
    as_is, otherwise = left_moments_nm(*body, turned(kinematics, 0.0))
    assert as_is == otherwise
