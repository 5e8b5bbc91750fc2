"""What the estimate solves for, as errors of the instruments."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.instrument_errors import laboratory_errors
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior


def test_errors_are_recorded_minus_true():
    """A plate that reads 20 % too little, 10 mm too far forward, 2 N m/kN too much, turned and late."""
    solved, sds = np.array([-0.01, 0.0, 0.25, -0.002, 0.05]), np.full(5, 0.001)
    errors = [error for _, _, error in laboratory_errors({"left": (solved, sds)}, (0.007, 0.001), InstrumentPrior())]
    assert [(str(error), error.value, error.unit) for error in errors] == [
        ("plate left: rotation", 0.05, "rad"),
        ("plate left: position x", 0.01, "m"),
        ("plate left: position z", 0.0, "m"),
        ("plate left: gain", -0.2, "1"),
        ("plate left: free moment", 0.002, "N m/N"),
        ("synchronisation: delay", 0.007, "s"),
    ]


def test_the_deviation_of_a_gain_is_that_of_the_error():
    mean, sd = 0.25, 0.001
    factors = 1.0 + np.random.default_rng(0).normal(mean, sd, 100_000)
    values, sds = np.array([0.0, 0.0, mean, 0.0, 0.0]), np.full(5, sd)
    (gain,) = [
        error
        for _, _, error in laboratory_errors({"left": (values, sds)}, (0.0, 0.001), InstrumentPrior())
        if error.quantity == "gain"
    ]
    assert gain.value == pytest.approx(np.mean(1.0 / factors - 1.0), abs=1e-5)
    assert gain.sd == pytest.approx(np.std(1.0 / factors), rel=0.02)
