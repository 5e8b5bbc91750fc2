"""P24, are the loads under the feet? Reports corrected plate positions, and whether it was the right plate.

Along the walking direction, an equal displacement of all plates looks like a displaced centre of mass of the trunk. So
straight walks in one direction determine the distance of two plates, but hardly the position of either: the prior
decides which one is faulty, mostly correctly. In a walk in the opposite direction the body is turned and the plates are
not: on OpenSim-made walks with one plate displaced by 20 mm, it lowers the SD of that plate's position from 5 to 1.2
mm.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected, correction, equal
from kinertia.estimation.simultaneous.calibration_entry import POSITION, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation, InstrumentPrior
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_OPEN_M = 1.0
_FIXED_M = 1e-6
"""Equal displacements of all plates and a displacement of the floor are the same: the floor is fixed."""
_HARDLY_M = 0.004
_BETTER = 0.7
_CERTAIN = 2.0
"""SDs by which plates must differ."""


def plate_positions(context: ResultContext) -> Iterator[Finding]:
    """Report corrected plate positions, as one finding where all plates are displaced equally, and directions in which
    another plate may be the displaced one.
    """
    for axis in "xz":
        errors = [one for one in context.errors if (one.quantity, one.axis) == (POSITION, axis)]
        if equal(errors):
            first = max(errors, key=lambda one: (one.supported, abs(one.value)))
            yield correction("P246", "offset_m", context.along(axis, None), first)
        else:
            yield from corrected(context, "P246", "offset_m", errors)
        yield from _ambiguous(context, axis, errors)


def _ambiguous(context: ResultContext, axis: str, errors: Sequence[CalibrationEntry]) -> list[Finding]:
    """Report P247: a plate seems displaced, but another may be instead. The uncertainty of each plate is ignored, since
    it is what is ambiguous, but the difference of the plates must be certain.
    """
    prior, posterior = context.ready.uncertainty.instruments, context.fit.posterior
    values = [one.value for one in errors if not one.contradicted_by]
    if posterior is None or prior.plate[axis].fault_probability == 0.0 or not values:
        return []
    differ_m = max(values) - min(values)
    if differ_m <= _CERTAIN * prior.plate[axis].sd:
        return []
    apart_m, each_m = position_deviations(posterior.instruments, prior, axis)
    if each_m <= _HARDLY_M or apart_m >= _BETTER * each_m or differ_m <= _CERTAIN * 2.0 * apart_m:
        return []
    found = finding(
        "P247",
        context.along(axis, None),
        difference_sd_m=Quantity(apart_m, "m", limit=_BETTER * each_m),
        mean_sd_m=Quantity(each_m, "m", limit=_HARDLY_M),
        difference_m=Quantity(differ_m, "m"),
    )
    return [found]


def position_deviations(shown: InstrumentInformation, prior: InstrumentPrior, axis: str) -> tuple[float, float]:
    """Return how precisely (m, m) trials alone determine plate positions along an axis: the worst SD from their middle,
    and the SD of their middle. Columns of the same name are one plate; a single plate has no middle.

    Args:
        shown: information of the trials on plates and synchronisation, without any prior.
        prior: their prior.
        axis: "x" or "z".
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
            common[k], own[list(members)] = _OPEN_M, one.nominal_sd
            places = places.difference(members) | {len(own) + k}
    if len(places) < 2:
        return np.inf, 0.0
    known = shown.information + prior.of_session(shown.plates).information
    information = priors.of_parts.T @ known @ priors.of_parts + np.diag(np.append(own, common) ** -2.0)
    covariance = np.linalg.inv(information)[np.ix_(sorted(places), sorted(places))]
    from_middle = np.eye(len(places)) - 1.0 / len(places)
    apart = np.sqrt(np.diag(from_middle @ covariance @ from_middle.T)).max()
    return float(apart), float(np.sqrt(covariance.mean()))
