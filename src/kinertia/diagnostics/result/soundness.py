"""R20, is the estimate sound? Convergence, physical possibility, distance from the prior, and masses: R10, S11, S40.

If one side is heavier, the cause is the body or something worn on it, even if single parameters are far from the prior.
If they are far without such a reason, a wrong joint, plate or marker is likelier than an unusual body.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.runner import check
from kinertia.estimation.prepared import mass_by_force_kg
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import UNLIKE_CHANCE, MahalanobisDistance, OneSided
from kinertia.findings.display import first_few
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters, impossible_segments
from kinertia.model.marker_set import SIDE_NAMES

CONTRADICTION_SD = Limit(3.0)
"""Prior SDs from which on a parameter contradicts what was expected."""
PLAIN_CONTRADICTION_SD = Limit(4.0)
"""A parameter this many prior SDs from its expected value is wrong by itself: the probability by chance is one in 16
000."""
MOST_DOUBTED_SEGMENTS = Limit(2)
"""Segments with a parameter beyond CONTRADICTION_SD that are taken with care; more contradict the whole model."""
CONTRADICTING_COM_M = Limit(0.1, "m")
"""A centre of mass this far from the literature contradicts it, if no prior states the variation between people: 34 mm
(SD) for a trunk."""
_ONE_SIDED_SD = Limit(4.0)
"""As in `one_sided`."""
_ARMS = ("upper_arm", "forearm", "hand")
_PARAMETER_WORDS = {
    "mass": "mass",
    "com": "centre of mass",
    "com_x": "fore-aft centre of mass",
    "com_y": "longitudinal centre of mass",
    "com_z": "mediolateral centre of mass",
}
_WRONG = "a misplaced marker or joint centre, or an error of a plate"
_WORN = "something worn or carried that was not declared ([[attached]])"
_OTHER = "a body that the tables do not describe (age_years, population under [subject])"
_MOTION = Limit(0.05)
"""Masses by force may differ by this share between inverse kinematics and the marker-based centre of mass."""
_TOTAL = Limit(0.03)
"""Share by which the estimated total mass may differ from the stated one."""
_IDENTIFIED_SD = Limit(2.0)
"""SDs of its mass from which on an attached item differs from nothing."""


@check(
    "R201",
    "R202",
    "R203",
    "R204",
    "R205",
    distance=CONTRADICTION_SD,
    plain=PLAIN_CONTRADICTION_SD,
    segments=MOST_DOUBTED_SEGMENTS,
    centre=CONTRADICTING_COM_M,
    chance=Limit(UNLIKE_CHANCE),
    asymmetry=_ONE_SIDED_SD,
)
def soundness(context: ResultContext) -> Iterator[Finding]:
    """Report what contradicts the estimate as a whole, or single parameters."""
    fit = context.fit
    if not fit.converged:
        steps = fit.evaluations if fit.posterior is None else fit.posterior.iterations
        yield finding("R201", iterations=Quantity(steps, "1"))
    yield from _impossible(fit)
    yield from _far_centres(fit) if fit.posterior is None else _far_parameters(fit)
    if fit.posterior is not None and (whole := fit.posterior.mahalanobis_distance).implausible:
        yield _unlike(whole) if whole.one_sided is None else _side_heavier(whole.one_sided)


def _impossible(fit: Fit) -> Iterator[Finding]:
    """Report R202: impossible bodies; light bodies of a model that were not estimated do not count against the
    estimate."""
    impossible = impossible_segments(fit.estimate)
    fixed = set()
    if fit.posterior is not None:
        kept = np.flatnonzero(~fit.posterior.prior_sd.any(axis=1))
        fixed = {fit.estimate.segments[i] for i in kept}
    estimated = [name for name in impossible if name not in fixed]
    if impossible:
        named = Quantity(first_few(estimated or impossible)), Quantity(len(estimated or impossible), "1")
        yield finding("R202", None, None if estimated else Severity.INFO, segments=named[0], count=named[1])


def _far_parameters(fit: Fit) -> Iterator[Finding]:
    """Report R203: every parameter beyond CONTRADICTION_SD; parameters of arms, whose shoulders lack an axis, do not
    count against the estimate."""
    away = fit.departures
    assert away is not None
    beyond = np.abs(away) > CONTRADICTION_SD
    arms = np.array([str(segment_of(name)).startswith(_ARMS) for name in fit.estimate.segments])
    whole = (beyond.any(axis=1) & ~arms).sum() > MOST_DOUBTED_SEGMENTS
    for row, column in np.argwhere(beyond):
        distance = float(away[row, column])
        plain = not arms[row] and (whole or abs(distance) > PLAIN_CONTRADICTION_SD)
        yield finding(
            "R203",
            _parameter(fit, row, PARAMETERS[column]),
            Severity.ERROR if plain else None,
            distance_sd=Quantity(distance, "1", limit=CONTRADICTION_SD),
            distance=Quantity(f"{distance:+.1f} SD"),
            parameter=Quantity(PARAMETERS[column]),
            source=Quantity(fit.expected_source),
        )


def _parameter(fit: Fit, row: int, parameter: str) -> Where:
    words = _PARAMETER_WORDS.get(parameter, f"moment of inertia {parameter}")
    name, _, side = fit.estimate.segments[row].rpartition("_")
    segment = f"{SIDE_NAMES[side]} {name}" if name and side in SIDE_NAMES else fit.estimate.segments[row]
    return Where(part=f"{words} of the {segment.replace('_', ' ')}")


def _far_centres(fit: Fit) -> Iterator[Finding]:
    """Report R203: every centre of mass that two-level has moved too far."""
    moved_m = np.linalg.norm(fit.estimate.com_m - fit.literature.com_m, axis=1)
    for row in np.flatnonzero(moved_m > CONTRADICTING_COM_M):
        yield finding(
            "R203",
            _parameter(fit, int(row), "com"),
            Severity.ERROR,
            distance_m=Quantity(float(moved_m[row]), "m", limit=CONTRADICTING_COM_M),
            distance=Quantity(f"{1e3 * moved_m[row]:.0f} mm"),
            parameter=Quantity("com"),
            source=Quantity(fit.expected_source),
        )


def _unlike(whole: MahalanobisDistance) -> Finding:
    """Report R204: the likeliest causes first: wrong joint centres affect both sides equally, a prosthesis does not."""
    wrong_first = (f"{_WRONG}: left and right deviate equally", _WORN, _OTHER)
    causes = wrong_first if whole.both_sides else (_WORN, _OTHER, _WRONG)
    limb = next((name for name in whole.segments if name.endswith(("_r", "_l"))), None)
    return finding(
        "R204",
        causes=causes if limb is None else (*causes, f"a prosthesis (prosthesis = true under [segment.{limb}])"),
        chance=Quantity(whole.chance, "1", limit=UNLIKE_CHANCE),
        combinations=Quantity(whole.combinations, "1"),
        segments=Quantity(", ".join(whole.segments)),
    )


def _side_heavier(side: OneSided) -> Finding:
    """Report R205: mass asymmetry; an attached item first where the heavier side is far from the prior, else a
    prosthesis."""
    of_segments = " or ".join(f'"{name}"' for name in side.heavier)
    tables = " and ".join(f"[segment.{name}]" for name in side.lighter)
    worn = f"an orthosis, cast or weight on the heavier side ([[attached]] with segment = {of_segments})"
    artificial = f"a prosthesis on the lighter side (prosthesis = true under {tables})"
    return finding(
        "R205",
        causes=(worn, artificial, _WRONG) if side.added else (artificial, worn, _WRONG),
        difference_kg=Quantity(side.more_kg if len(side.more_kg) > 1 else side.more_kg[0], "kg"),
        distance_sd=Quantity(side.times, "1", limit=_ONE_SIDED_SD),
        heavier=Quantity(" and ".join(side.heavier)),
        lighter=Quantity(" and ".join(side.lighter)),
    )


def mass_from_force_kg(literature: BodySegmentParameters, trial: TrialFit) -> float:
    """Compute body mass (kg) from the vertical ground reaction of a fitted trial and its inverse kinematics."""
    return mass_by_force_kg(literature, trial.kinematics.foot_loads, trial.residuals["literature"])


@check("R107", share=_MOTION)
def forces_of_the_motion(context: ResultContext) -> Iterator[Finding]:
    """Report R107: trials whose forces give another body mass with the motion of inverse kinematics than with the
    markers'."""
    for trial in context.fit.trials:
        by_markers = context.force_masses.get(trial.name)
        if by_markers is None:
            continue
        by_motion_kg = mass_from_force_kg(context.ready.literature, trial)
        limit = _MOTION * by_markers.mass_kg + 2.0 * by_markers.sd_kg
        if abs(by_motion_kg - by_markers.mass_kg) > limit:
            yield finding(
                "R107",
                Where(trial=trial.name),
                by_motion_kg=Quantity(by_motion_kg, "kg", limit=limit),
                by_markers_kg=Quantity(by_markers.mass_kg, "kg", sd=by_markers.sd_kg),
            )


@check("S113", share=_TOTAL)
def total_mass(context: ResultContext) -> Iterator[Finding]:
    """Report S113: an estimated total mass that follows the plates more than the stated mass."""
    total_kg, stated = context.fit.estimate.total_mass_kg, context.ready.total_mass
    limit = _TOTAL * stated.total_kg + 2.0 * stated.sd_kg
    if abs(total_kg - stated.total_kg) > limit:
        yield finding(
            "S113",
            estimate_kg=Quantity(total_kg, "kg", limit=limit),
            stated_kg=Quantity(stated.total_kg, "kg", sd=stated.sd_kg),
        )


@check("S407", distance=_IDENTIFIED_SD)
def attached_items(context: ResultContext) -> Iterator[Finding]:
    """Report S407: attached items of unknown mass that the trials cannot distinguish from zero."""
    estimate, posterior = context.fit.estimate, context.fit.posterior
    for item in () if posterior is None else context.ready.attached:
        row = estimate.segments.index(item.name)
        mass_kg, sd_kg = float(estimate.mass_kg[row]), float(posterior.sd[row, 0]) if posterior else 0.0
        if item.mass_kg is None and mass_kg < _IDENTIFIED_SD * sd_kg:
            mass = Quantity(mass_kg, "kg", limit=_IDENTIFIED_SD * sd_kg, sd=sd_kg)
            yield finding(
                "S407", Where(part=item.name), mass_kg=mass, sd=Quantity(sd_kg, "kg"), name=Quantity(item.name)
            )
