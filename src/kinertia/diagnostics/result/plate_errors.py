"""P22 to P28, are the plates right? Reports gains, rotations, positions and moments that the estimate found.

Along the walking direction, an equal displacement of all plates looks like a displaced centre of mass of the trunk. So
straight walks in one direction determine the distance of two plates, but hardly the position of either: the prior
decides which one is faulty, mostly correctly. In a walk in the opposite direction the body is turned and the plates are
not: on OpenSim-made walks with one plate displaced by 20 mm, it lowers the SD of that plate's position from 5 to 1.2
mm.

An equal displacement of all plates along the walking direction has the same effect as shifted centres of mass. Without
a walk in the opposite direction, the prior mostly keeps the plates where the files have them: in eight walks made by
OpenSim with both plates 20 mm too far forward, knee and ankle moments are wrong by 7 N m, and 46 to 54 % of them lie in
their 95 % intervals. With a second walk in the opposite direction, 18 of 20 mm are found.

A rotation shows in the direction in which the ground accelerates the body. Where noisy markers contain little
information on that, the prior takes the plates as fault-free, and a rotation of a few degrees goes unnoticed into the
joint moments.

The estimate determines gains only from the stated mass: plates that read a tenth more may read too much, or carry a
tenth more. Two plates have two amplifiers and two calibrations, but a person has one mass, so an error common to both
plates is first attributed to the mass, or to something carried.

In some measured walks the motion needs free moments that differ from the measured ones by 3 to 6 N m/kN, in opposite
directions under the right and the left foot; in single support the vertical moment is also wrong by 1 to 3 N m before
the estimate. If reversing their sign does not explain it, two plates are unlikely to be the cause. The model is more
likely: an error of some tenths of a kg m2/s in the angular momentum of legs, trunk and arms has this effect, and a
trunk that bends, or skin over pelvis and shoulders, can cause it. The error of a plate appears under one foot, or under
both in the same direction, and in the mean over whole strides.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected, correction, equal, reported
from kinertia.diagnostics.runner import check
from kinertia.estimation.free_moment_sign import VERTICAL, residual_moments_nm, residual_moments_without_offsets_nm
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.instruments.instrument_errors import (
    FREE_MOMENT,
    GAIN,
    POSITION,
    ROTATION,
    CalibrationEntry,
)
from kinertia.estimation.simultaneous.instruments.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS
from kinertia.estimation.simultaneous.instruments.priors import (
    FLOOR_PRIOR,
    PLATE_PRIOR,
    TRIAL_GAIN_PRIOR,
    InstrumentInformation,
    InstrumentPrior,
)
from kinertia.estimation.simultaneous.uncertainty.evidence import SURE
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where

_POSITION_SD_M, _ROTATION_SD_RAD = (
    float(np.hypot(PLATE_PRIOR[name].sd, FLOOR_PRIOR[name].sd)) for name in ("x", "turn")
)
"""Of a plate's own error and that of all plates together."""
_TRIAL_GAIN_SD = float(np.hypot(PLATE_PRIOR["gain"].sd, TRIAL_GAIN_PRIOR.sd))
"""Of a plate's gain in one trial."""
_OPEN_M = 1.0
_FIXED_M = 1e-6
"""Equal displacements of all plates and a displacement of the floor are the same: the floor is fixed."""
_HARDLY_M = Limit(0.004, "m")
_BETTER = Limit(0.7)
_CERTAIN = 2.0
"""SDs by which plates must differ."""
_MATTERS_M = Limit(0.015, "m")
"""Of three walks that show 19 mm sideways, two do not show plates displaced by 20 mm: their moments err by 5 N m."""
_MATTERS_RAD = Limit(np.radians(2.0), "rad")
"""In the least informative walk of the reference recordings, 3 degrees change joint moments by twice their SDs."""
_OF_ONE_MATTERS_RAD = Limit(np.radians(4.0), "rad")
"""In reference walks, 5 degrees of one plate change joint moments by one to two SDs."""
_LARGEST_RAD = Limit(np.radians(10.0), "rad")
"""Three prior SDs of a rotated plate. A larger estimate points to another fault, which no rotation corrects."""
_AMPLIFIER = "a calibration, amplifier or unit that all plates have in common"
_MORE = ("something worn or carried that the stated mass leaves out", "a wrong stated mass", _AMPLIFIER)
_LESS = ("a wrong stated mass", "support that no plate measures (handrail, walker, crutches, harness)", _AMPLIFIER)
_LESS_REVERSED = Limit(0.8)
"""Share of the residual as measured, below which the residual with the sign reversed speaks against the sign."""
_ONE_SIDED = 0.5
"""Share of the errors' sizes above which their sum is not that of mirror images."""


@check(
    "P246",
    "P247",
    position=reported(_POSITION_SD_M, "m"),
    difference=Limit(_CERTAIN * PLATE_PRIOR["x"].sd, "m"),
    better=_BETTER,
    hardly=_HARDLY_M,
)
def plate_positions(context: ResultContext) -> Iterator[Finding]:
    """Report corrected plate positions, as one finding where all plates are displaced equally, and directions in which
    another plate may be the displaced one.
    """
    for axis in "xz":
        errors = [error for error in context.errors if (error.quantity, error.axis) == (POSITION, axis)]
        if equal(errors):
            first = max(errors, key=lambda error: (error.supported, abs(error.value)))
            yield correction("P246", "offset_m", context.along(axis, None), first)
        else:
            yield from corrected(context, "P246", "offset_m", errors)
        yield from _ambiguous(context, axis, errors)


def _ambiguous(context: ResultContext, axis: str, errors: Sequence[CalibrationEntry]) -> list[Finding]:
    """Report P247: a plate seems displaced, but another may be instead. The uncertainty of each plate is ignored, since
    it is what is ambiguous, but the difference of the plates must be certain.
    """
    prior, posterior = context.ready.uncertainty.instruments, context.fit.posterior
    values = [error.value for error in errors if not error.contradicted_by]
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
    individual_sd = np.array([error_prior.faulty_sd for error_prior in priors.individual])
    common = np.array([common_prior.faulty_sd for common_prior, _ in priors.common])
    individual_sd[size * len(shown.plates) + list(FLOOR_UNKNOWNS).index(axis)] = _FIXED_M
    along = [size * plate + list(PLATE_UNKNOWNS).index(axis) for plate in range(len(shown.plates))]
    individual_sd[along] = _OPEN_M
    places = set(along)
    for k, (common_prior, members) in enumerate(priors.common):
        if members[0] in places:
            common[k], individual_sd[list(members)] = _OPEN_M, common_prior.nominal_sd
            places = places.difference(members) | {len(individual_sd) + k}
    if len(places) < 2:
        return np.inf, 0.0
    known = shown.information + prior.of_session(shown.plates).information
    information = priors.of_parts.T @ known @ priors.of_parts + np.diag(np.append(individual_sd, common) ** -2.0)
    covariance = np.linalg.inv(information)[np.ix_(sorted(places), sorted(places))]
    from_middle = np.eye(len(places)) - 1.0 / len(places)
    apart = np.sqrt(np.diag(from_middle @ covariance @ from_middle.T)).max()
    return float(apart), float(np.sqrt(covariance.mean()))


@check("P248", matters=_MATTERS_M)
def common_offset(context: ResultContext) -> Iterator[Finding]:
    """Report axes along which a displacement of all plates that matters would go unnoticed."""
    if context.fit.posterior is None:
        return
    known = context.fit.posterior.instruments, context.ready.uncertainty.instruments
    for axis in "xz":
        least_m = smallest_detectable(*known, axis)
        if _MATTERS_M < least_m < np.inf:
            yield finding("P248", context.along(axis, None), detectable_m=Quantity(least_m, "m", limit=_MATTERS_M))


@check(
    "P234",
    "P235",
    "P237",
    rotation=reported(_ROTATION_SD_RAD, "rad"),
    largest=_LARGEST_RAD,
    of_all=_MATTERS_RAD,
    of_one=_OF_ONE_MATTERS_RAD,
)
def plate_rotation(context: ResultContext) -> Iterator[Finding]:
    """Report rotations that were corrected, of all plates or of one, and one too small for these trials to show."""
    rotations = [error for error in context.errors if error.quantity == ROTATION]
    usual_sd = context.ready.uncertainty.instruments.plate["turn"].sd
    if equal(rotations, usual_sd) or len(rotations) == 1:
        largest = max(rotations, key=lambda error: abs(error.value))
        yield from corrected(context, "P234", "rotation_rad", [replace(largest, plate=None)], _LARGEST_RAD)
    else:
        yield from corrected(context, "P237", "rotation_rad", rotations, _LARGEST_RAD)
    if context.fit.posterior is None:
        return
    known = context.fit.posterior.instruments, context.ready.uncertainty.instruments
    all_rad, one_rad = smallest_detectable(*known, "turn"), smallest_detectable_of_one(*known, "turn")
    if _MATTERS_RAD < all_rad < np.inf or _OF_ONE_MATTERS_RAD < one_rad < np.inf:
        of_all, of_one = (
            Quantity(all_rad, "rad", limit=_MATTERS_RAD),
            Quantity(one_rad, "rad", limit=_OF_ONE_MATTERS_RAD),
        )
        yield finding("P235", detectable_rad=of_all, of_one_rad=of_one)


def smallest_detectable(shown: InstrumentInformation, prior: InstrumentPrior, unknown: str) -> float:
    """Return the smallest error of all plates that the trials make likelier than fault-free ones; infinite if none is.

    Args:
        shown: information of the trials on plates and synchronisation, without any prior.
        prior: their prior, including information from other people of the session.
        unknown: one of FLOOR_UNKNOWNS.
    """
    return _smallest(shown, prior, len(shown.rhs) - 1 - len(FLOOR_UNKNOWNS) + list(FLOOR_UNKNOWNS).index(unknown))


def smallest_detectable_of_one(shown: InstrumentInformation, prior: InstrumentPrior, unknown: str) -> float:
    """Return the same of an error of a single plate (one of PLATE_UNKNOWNS), whichever shows it least."""
    first, count = list(PLATE_UNKNOWNS).index(unknown), len(PLATE_UNKNOWNS)
    return max((_smallest(shown, prior, first + count * k) for k in range(len(shown.plates))), default=0.0)


def _smallest(shown: InstrumentInformation, prior: InstrumentPrior, place: int) -> float:
    unknowns = prior.of_unknowns(shown.plates).individual
    precision = np.array([0.0 if k == place else 1.0 / unknown_prior.sd**2 for k, unknown_prior in enumerate(unknowns)])
    information = shown.information + prior.of_session(shown.plates).information + np.diag(precision)
    if not information[place, place] > 0.0:
        return np.inf
    deviation = float(np.sqrt(np.linalg.inv(information)[place, place]))
    return unknowns[place].smallest_detectable(deviation)


@check("P223", "P224", gain=reported(PLATE_PRIOR["gain"].sd, "1"), trial_gain=reported(_TRIAL_GAIN_SD, "1"))
def gains(context: ResultContext) -> Iterator[Finding]:
    """Report gain errors that were corrected, and one that all plates share, in all trials or in one."""
    errors = [error for error in context.errors if error.quantity == GAIN]
    yield from corrected(context, "P223", "gain_error", _certain(errors))
    lasting = [error for error in errors if error.trial is None]
    if equal(lasting):
        yield _of_all(context, lasting)
        return
    usual = min((gain.prior_sd for gain in lasting), default=np.inf)
    for trial in dict.fromkeys(error.trial for error in errors if error.trial is not None):
        of_trial = [error for error in errors if error.trial == trial]
        if equal(of_trial, usual):
            yield _of_all(context, of_trial)


@check("P288", log_odds=Limit(SURE))
def missing_loads(context: ResultContext) -> Iterator[Finding]:
    """Report P288: plates of whose loads a part is missing, which is no error of their gain."""
    posterior = context.fit.posterior
    for missing_load in () if posterior is None else posterior.missing_loads:
        missing = Quantity(missing_load.missing, "1", sd=missing_load.sd)
        log_odds = Quantity(missing_load.log_odds, "1", limit=SURE)
        yield finding(
            "P288",
            Where(trial=missing_load.trial, plate=missing_load.plate, span_s=missing_load.span_s),
            missing=missing,
            log_odds=log_odds,
        )


def _of_all(context: ResultContext, gains: Sequence[CalibrationEntry]) -> Finding:
    """Report P224: a gain error of all plates, with the masses that the forces of the trials correspond to."""
    trial, total = gains[0].trial, context.ready.total_mass
    sd, limit = max(gain.sd for gain in gains), 2.0 * gains[0].prior_sd
    evidence = {"gain_error": Quantity(tuple(gain.value for gain in gains), "1", limit, sd=sd)}
    masses = tuple(float(mass.mass_kg) for name, mass in context.force_masses.items() if trial in (None, name))
    if masses:
        evidence["mass_by_force_kg"] = Quantity(masses, "kg")
    evidence["stated_kg"] = Quantity(total.total_kg, "kg", sd=total.sd_kg)
    evidence["plates"] = Quantity(", ".join(str(gain.plate) for gain in gains))
    return with_evidence("P224", Where(trial=trial), evidence, causes=_MORE if gains[0].value > 0.0 else _LESS)


def _certain(errors: Sequence[CalibrationEntry]) -> Iterator[CalibrationEntry]:
    """Yield the gain of a plate over all trials where that is certain, else its gain in each trial."""
    lasting = {error.plate: error for error in errors if error.trial is None}
    of_trials = {error.plate for error in errors if error.trial is not None}
    for error in errors:
        whole = error.plate not in of_trials or lasting[error.plate].supported
        if whole == (error.trial is None):
            yield error


@check(
    "P260", "P265", "P267", "P268", "P269", error=reported(PLATE_PRIOR["free moment"].sd, "N m/N"), less=_LESS_REVERSED
)
def free_moments(context: ResultContext) -> Iterator[Finding]:
    """Report a wrong sign of the free moments, and the errors that remain once it is right."""
    posterior = context.fit.posterior
    if posterior is None:
        for trial in context.fit.trials:
            yield from reversed_sign(trial)
        return
    if sign := posterior.free_moment_sign:
        evidence = {"rms_nm": Quantity(sign.rms_nm, "N m"), "log_odds": Quantity(sign.log_odds, "1")}
        if sign.wrong:
            yield with_evidence("P269", Where(), evidence)
        elif sign.open:
            yield with_evidence("P260", Where(), evidence)
    errors = [error for error in context.errors if error.quantity == FREE_MOMENT]
    yield from corrected(context, "P267", "error_nm_n", errors)
    if mirrored(errors):
        values = tuple(error.value for error in errors)
        plates = Quantity(", ".join(str(error.plate) for error in errors))
        yield finding("P268", error_nm_n=Quantity(values, "N m/N", 2.0 * errors[0].prior_sd), plates=plates)


def mirrored(errors: Sequence[CalibrationEntry]) -> bool:
    """Return whether errors were found under both feet that mirror each other: opposite signs, similar sizes."""
    off = [error.value for error in errors if error.found]
    if not off or not min(off) < 0.0 < max(off):
        return False
    return abs(sum(error.value for error in errors)) <= _ONE_SIDED * sum(abs(error.value) for error in errors)


def reversed_sign(trial: TrialFit) -> Iterator[Finding]:
    """Report P265: a trial whose free moments follow the measured motion once their sign is reversed, for an estimate
    without evidence of its own.
    """
    if not trial.kinematics.complete:
        return
    left, loads = trial.residuals["literature"][:, VERTICAL], trial.kinematics.foot_loads
    as_is, reversed_nm = residual_moments_nm(left, loads)
    without, reversed_without = residual_moments_without_offsets_nm(left, loads)
    if reversed_nm < _LESS_REVERSED * as_is and reversed_without < _LESS_REVERSED * without:
        evidence = {
            "rms_nm": Quantity(as_is, "N m"),
            "reversed": Quantity(reversed_nm, "N m", limit=_LESS_REVERSED * as_is),
        }
        yield with_evidence("P265", Where(trial=trial.name), evidence)
