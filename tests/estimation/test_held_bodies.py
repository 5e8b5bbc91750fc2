"""A held body's mass and place, added to the body it moves with, are what the first-order changes say."""

import numpy as np
import pytest

from kinertia.estimation.held_bodies import POSTURE_SD_RAD, _changes
from kinertia.estimation.prepare_osim import kind_of, parted
from kinertia.estimation.prior import literature_prior
from kinertia.io.osim.reader import read_osim


def combined(mass, com, inertia, more_kg, at):
    """Mass, centre of mass and inertia about it of a body and a point mass."""
    total = mass + more_kg
    centre = (mass * com + more_kg * at) / total
    result = inertia.copy()
    for m, p in ((mass, com - centre), (more_kg, at - centre)):
        result = result + m * (p @ p * np.eye(3) - np.outer(p, p))
    return np.array([total, *centre, *result[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]])


def test_changes_are_derivatives_of_the_combined_body():
    rng = np.random.default_rng(0)
    mass, held_kg, com, away = 1.2, 0.5, rng.normal(size=3) / 10, rng.normal(size=3) / 5
    inertia, step = np.diag([0.01, 0.002, 0.01]), 1e-6
    changes = _changes(mass, held_kg, away)
    base = combined(mass, com, inertia, 0.0, com + away)
    found = (combined(mass, com, inertia, step, com + away) - base) / step
    np.testing.assert_allclose(found, changes[:, 0], rtol=1e-5, atol=1e-9)

    def about_com(place):
        inertia = held_kg * (place @ place * np.eye(3) - np.outer(place, place))
        return np.array([0.0, *held_kg * place / mass, *inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]])

    slopes = [(about_com(away + step * along) - about_com(away - step * along)) / (2 * step) for along in np.eye(3)]
    np.testing.assert_allclose(np.transpose(slopes), changes[:, 1:], atol=1e-9)


def test_a_forearm_may_be_off_by_what_its_hand_may(shared_data):
    """The wrists are locked: 0.52 kg some 7 cm beyond them, bent by 20 degrees."""
    model = read_osim(shared_data / "rajagopal_walk" / "scaled.osim")
    prior, held = parted(model.skeleton, model.bsp)
    alone = literature_prior(model.bsp, [kind_of(name) for name in model.bsp.segments])
    row = {name: k for k, name in enumerate(model.bsp.segments)}
    hand, radius, humerus = (held.segments.index("hand_r"), *map(prior.mean.segments.index, ("radius_r", "humerus_r")))
    swing = POSTURE_SD_RAD * np.linalg.norm(held.com_m[hand])
    by_posture = held.mass_kg[hand] / prior.mean.mass_kg[radius] * swing
    assert by_posture > 0.01
    assert prior.sd[radius, 1] >= np.hypot(alone.sd[row["radius_r"], 1], by_posture)
    assert prior.sd[radius, 0] == pytest.approx(np.hypot(*(alone.sd[row[name], 0] for name in ("radius_r", "hand_r"))))
    # nothing hangs on an upper arm
    np.testing.assert_allclose(prior.sd[humerus], alone.sd[row["humerus_r"]])
