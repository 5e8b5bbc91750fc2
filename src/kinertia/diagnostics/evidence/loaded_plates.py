"""Weighs the person on the plates, and lists the samples under load."""

from collections.abc import Iterator

import numpy as np

from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import FloatArray, PlateLoads

_ADULT_N = 70.0 * GRAVITY_M_S2
_HEAVIEST_PERCENT = 95.0
STEP_N, _FEWEST = 350.0, 10
"""Half the weight of an adult, which no bump has; so many samples under load, at least."""


def adult_share(plates: PlateLoads | None, mass_kg: float | None = None) -> float:
    """Return body weight as a share of a 70 kg adult's, at most 1: limits in newtons are an adult's times this share.

    Where no mass is stated, the heaviest loads on all plates stand for body weight. They are 1.1 times body weight in a
    walk and more in a run: an overestimate, so that a limit is never too low for the person.
    """
    if mass_kg is not None:
        return min(1.0, mass_kg * GRAVITY_M_S2 / _ADULT_N)
    total = np.zeros(0) if plates is None else plates.force[..., 1].sum(axis=1)
    loaded = total[total > FIRM_LOAD_N]
    if len(loaded) < _FEWEST:
        return 1.0
    return min(1.0, float(np.percentile(loaded, _HEAVIEST_PERCENT)) / _ADULT_N)


def wrenches(plates: PlateLoads) -> Iterator[tuple[str, FloatArray]]:
    """Yield the name and wrench (k, 6) of every plate."""
    return zip(plates.names, np.moveaxis(plates.wrench, 1, 0), strict=True)


def loaded_wrenches(plates: PlateLoads, fewest: int = 1) -> Iterator[tuple[str, FloatArray]]:
    """Yield the name and wrench (j, 6) of the loaded samples of every plate that has at least `fewest` of them."""
    for name, wrench in wrenches(plates):
        loaded = wrench[wrench[:, 1] > FIRM_LOAD_N]
        if len(loaded) >= fewest:
            yield name, loaded


def carrying(plates: PlateLoads, share: float) -> Iterator[tuple[str, FloatArray]]:
    """Yield name and wrench (j, 6) of the loaded samples of every plate that carries a person of this `adult_share`."""
    return ((name, loaded) for name, loaded in loaded_wrenches(plates, _FEWEST) if loaded[:, 1].max() >= STEP_N * share)
