"""Whether the trials of a person tell which plate is off, or only that plates differ.

Along the way a person walks, plates that are all off by as much look like a trunk whose centre of mass lies elsewhere.
So straight walks in one direction know how far two plates are apart, and hardly where either stands: the prior decides
which is the faulty one, mostly well. In a walk the other way the body is turned and the plates are not: on OpenSim-made
walks with one plate 20 mm off, it brings the deviation of that plate's place from 5 to 1.2 mm.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinertia.estimation.simultaneous.instrument_warnings import ALONG, Entry, notable
from kinertia.estimation.simultaneous.instruments import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS

_PLACES = ("x", "z")
_OPEN_M = 1.0
_FIXED_M = 1e-6
"""Plates and floor that are off alike are the same: the floor stays."""
_HARDLY_M = 0.004
_BETTER = 0.7
_CERTAIN = 2.0
"""Deviations by which plates must differ."""
_AT_ITS_PLACE: Entry = {"value": 0.0, "prior_sd": 1.0}


def which_plate_warnings(
    calibration: Mapping[str, Entry],
    shown: InstrumentInformation,
    prior: InstrumentPrior,
    along: Mapping[str, str] = ALONG,
) -> list[str]:
    """One sentence for each direction in which a plate is found off, and another may be as well.

    Args:
        calibration: what a fit found.
        shown: what its trials say of plates and clock, without any prior.
        prior: what was known of them before.
        along: how their axes are called.
    """
    sentences = []
    for axis in _PLACES:
        places = {
            plate: calibration.get(f"plate {plate.removeprefix('plate ')}: {axis}", _AT_ITS_PLACE)
            for plate in shown.plates
        }
        off = [one for one in places.values() if notable(one) and not one.get("contradicted_by")]
        if prior.plate[axis].faulty_share == 0.0 or not off:
            continue
        apart_m, each_m = _deviations(shown, prior, axis)
        values = [float(one["value"]) for one in places.values()]
        differ_m = max(values) - min(values)
        if each_m > _HARDLY_M and apart_m < _BETTER * each_m and differ_m > _CERTAIN * 2.0 * apart_m:
            sentences.append(
                f"one of the plates is displaced {along[axis]}, by about {1e3 * differ_m:.0f} mm against the others, "
                f"but these trials cannot show which (they know to {1e3 * apart_m:.1f} mm that plates differ, and to "
                f"{1e3 * each_m:.1f} mm where all stand); add a walk in the opposite direction, or check the plates' "
                "places ([instruments] plate_sd_mm)"
            )
    return sentences


def _deviations(shown: InstrumentInformation, prior: InstrumentPrior, axis: str) -> tuple[float, float]:
    """(m, m) how well trials know places of plates along an axis of which nothing was known before: from their middle,
    the worst, and their middle. Columns of the same name are one plate; a single plate has no middle.
    """
    priors, size = prior.of_unknowns(shown.plates), len(PLATE_UNKNOWNS)
    own = np.array([one.faulty_sd for one in priors.own])
    common = np.array([one.faulty_sd for one, _ in priors.common])
    own[size * len(shown.plates) + list(FLOOR_UNKNOWNS).index(axis)] = _FIXED_M
    along = [size * plate + list(PLATE_UNKNOWNS).index(axis) for plate in range(len(shown.plates))]
    own[along] = _OPEN_M
    places = set(along)
    for k, (one, members) in enumerate(priors.common):
        if members[0] in places:
            common[k], own[list(members)] = _OPEN_M, one.sound_sd
            places = places.difference(members) | {len(own) + k}
    if len(places) < 2:
        return np.inf, 0.0
    known = shown.information + prior.of_session(shown.plates).information
    information = priors.of_parts.T @ known @ priors.of_parts + np.diag(np.append(own, common) ** -2.0)
    covariance = np.linalg.inv(information)[np.ix_(sorted(places), sorted(places))]
    from_middle = np.eye(len(places)) - 1.0 / len(places)
    apart = np.sqrt(np.diag(from_middle @ covariance @ from_middle.T)).max()
    return float(apart), float(np.sqrt(covariance.mean()))
