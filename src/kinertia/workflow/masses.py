"""Adjusts the prior of mass: what is not body is added; a stated mass that all plates contradict is replaced.

Each becomes a segment of its own, welded to the one that it moves with: it enters the dynamics, the error bars and the
exported model like any segment. What is known about its mass, place and size is its prior. The motion cannot
distinguish it from the segment that carries it, but the scale can: the body was weighed with it, or without. The masses
of the body's segments are shares of the body mass that remains on the scale, so they are lighter the heavier an item
weighed with the body.

The estimate determines gains only from the stated mass. Two plates have two amplifiers and two calibrations, and a
person has one mass: if every plate has a gain error in the same direction, the mass is doubted first.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from kinertia.errors import PriorError
from kinertia.estimation.prepared import Prepared, known, mass_of
from kinertia.estimation.prior import SECOND_MOMENT_SD, BspPrior, inertia_covariance
from kinertia.estimation.simultaneous.fit import SimultaneousFit
from kinertia.estimation.simultaneous.instruments.instrument_errors import GAIN, CalibrationEntry
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Joint, Skeleton
from kinertia.settings import Attached

_UNKNOWN_SIZE_SD = 0.5
"""Relative SD of the second moments of an item whose size is not stated."""
_WATER_KG_M3 = 1000.0
_GROUND = "ground"
_DOUBTED = "S111"
_FEWEST = 2
"""Number of agreeing occasions or plates from which on they are likelier to be right than a written number."""
_FEWEST_PLATES, _ALIKE = 2, 0.5
"""Fewest plates, and the smallest of their gain errors as a share of the largest. A foot that reaches over the edge of
one plate adds to its error: 8 and 11 % for a mass that is wrong by 12 %."""
_LEAST = 0.03
"""Share of the mass from which the estimated mass is reported to differ."""
_UNINFORMED = (0.1, 0.9)
"""Shares of the prior SD: an unloaded plate has no error and the prior's standard deviation."""


def with_attached(ready: Prepared, by_itself: Collection[str] = ()) -> Prepared:
    """Add segments for `ready.attached` after the body's own.

    Args:
        ready: the person.
        by_itself: segments whose prior masses are no shares of the body's.

    Raises:
        PriorError: no such segment, or a name that is taken.
    """
    if not ready.attached:
        return ready
    stated_mass_kg = known(ready.subject.mass_kg)
    skeleton, prior = with_attached_prior(ready.skeleton, ready.prior, ready.attached, stated_mass_kg, by_itself)
    # the literature's own body, which need not be the prior's mean, and fixed segments after all others
    body, literature = len(ready.prior.mean.segments), ready.literature
    names = (*prior.mean.segments, *literature.segments[body:])
    table = np.concatenate([literature.table()[:body], prior.mean.table()[body:], literature.table()[body:]])
    return replace(
        ready,
        skeleton=skeleton,
        prior=prior,
        literature=BodySegmentParameters.from_table(names, table),
        findings=(*ready.findings, *(_assumed(item, stated_mass_kg) for item in ready.attached)),
    )


def with_attached_prior(
    skeleton: Skeleton,
    prior: BspPrior,
    attached: Sequence[Attached],
    stated_mass_kg: float,
    by_itself: Collection[str] = (),
) -> tuple[Skeleton, BspPrior]:
    """Weld attached items to a skeleton, and extend the prior of the body by them.

    Args:
        skeleton, prior: skeleton and prior of the body alone.
        attached: items in the order of the new segments.
        stated_mass_kg: mass shown by the scale.
        by_itself: segments whose prior masses are no shares of the body's.

    Raises:
        PriorError: no such segment, or a name that is taken.
    """
    _check(skeleton, attached)
    joints = tuple(Joint(item.segment, item.name, np.eye(3), np.zeros(3), ()) for item in attached)
    return replace(skeleton, joints=(*skeleton.joints, *joints)), _extended(prior, attached, stated_mass_kg, by_itself)


def _check(skeleton: Skeleton, attached: Sequence[Attached]) -> None:
    taken = list(skeleton.segments)
    for item in attached:
        if item.segment not in skeleton.segments:
            raise PriorError(
                f"[[attached]] {item.name}: the model has no segment '{item.segment}'; it has "
                f"{', '.join(skeleton.segments)}"
            )
        if item.name == _GROUND:
            raise PriorError(f"[[attached]] {_GROUND}: this is OpenSim's name for the laboratory; give it another name")
        if item.name in taken:
            raise PriorError(f"[[attached]] {item.name}: there is a segment of this name already; give it another")
        taken.append(item.name)


def _extended(
    prior: BspPrior, attached: Sequence[Attached], stated_mass_kg: float, by_itself: Collection[str]
) -> BspPrior:
    """Extend the prior by attached items: the heavier an item weighed with the body, the lighter the body."""
    tables, blocks = zip(*(_expected(item, *mass_of(item, stated_mass_kg)) for item in attached), strict=True)
    names = (*prior.mean.segments, *(item.name for item in attached))
    size = len(prior.covariance)
    covariance = np.zeros((10 * len(names),) * 2)
    covariance[:size, :size] = prior.covariance
    for k, block in enumerate(blocks):
        rows = slice(size + 10 * k, size + 10 * k + 10)
        covariance[rows, rows] = block
        if attached[k].on_scale:
            mass_kg, sd_kg = mass_of(attached[k], stated_mass_kg)
            less, more = _less_body(prior, by_itself), _by_mass(tables[k], mass_kg)
            covariance[:size, :size] += sd_kg**2 * np.outer(less, less)
            covariance[:size, rows] = sd_kg**2 * np.outer(less, more)
            covariance[rows, :size] = covariance[:size, rows].T
    mean = BodySegmentParameters.from_table(names, np.concatenate([prior.mean.table(), *tables]))
    weighed = (*(True,) * len(prior.mean.segments), *(item.on_scale for item in attached))
    # the body's own rows are for a person weighed without the items that were on the scale
    on_scale = sum(mass_of(item, stated_mass_kg)[0] for item in attached if item.on_scale)
    return replace(prior, mean=mean, covariance=covariance, mass_kg=prior.mass_kg + on_scale, weighed=weighed)


def _expected(attached: Attached, mass_kg: float, sd_kg: float) -> tuple[np.ndarray, np.ndarray]:
    """Return an item's row (1, 10) and covariance (10, 10): inertia in proportion to mass, and an SD of its own."""
    if attached.size_mm is None:
        radius = (3.0 * mass_kg / (4.0 * np.pi * _WATER_KG_M3)) ** (1.0 / 3.0)
        second, own_sd = np.full(3, 0.2 * mass_kg * radius**2), _UNKNOWN_SIZE_SD
    else:
        second, own_sd = mass_kg / 12.0 * np.square(1e-3 * np.array(attached.size_mm)), SECOND_MOMENT_SD
    inertia = np.diag(second.sum() - second)
    body = BodySegmentParameters(
        (attached.name,), np.array([mass_kg]), 1e-3 * np.array([attached.com_mm]), inertia[None]
    )
    table = body.table()
    covariance = np.zeros((10, 10))
    covariance[1:4, 1:4] = np.square(1e-3 * attached.com_sd_mm) * np.eye(3)
    covariance[4:, 4:] = (own_sd / SECOND_MOMENT_SD) ** 2 * inertia_covariance(body)[0]
    by_mass = _by_mass(table, mass_kg)
    return table, covariance + sd_kg**2 * np.outer(by_mass, by_mass)


def _by_mass(table: np.ndarray, mass_kg: float) -> np.ndarray:
    """Return the change (10,) of an item's row (1, 10) per kilogram of its mass."""
    result: np.ndarray = np.r_[1.0, np.zeros(3), table[0, 4:] / mass_kg]
    return result


def _less_body(prior: BspPrior, by_itself: Collection[str]) -> np.ndarray:
    """Return the change (10 s,) of the body's rows per kilogram on the scale that is not part of the body."""
    change = -prior.mean.table() / prior.mean.total_mass_kg
    change[:, 1:4] = 0.0
    change[[name in by_itself for name in prior.mean.segments]] = 0.0
    return change.ravel()


def _assumed(attached: Attached, stated_mass_kg: float) -> Finding:
    mass_kg, sd_kg = mass_of(attached, stated_mass_kg)
    mass = "of unknown mass, which is estimated" if attached.mass_kg is None else f"{mass_kg:.4g} +- {sd_kg:.2g} kg"
    weighed = "weighed with the person" if attached.on_scale else "not on the scale"
    source = Quantity(f"{attached.name} attached to {attached.segment}, {mass}, {weighed}")
    return finding("S408", Where(part=attached.name), source=source)


def with_doubted_mass(prior: BspPrior, findings: Sequence[Finding]) -> BspPrior:
    """Return the prior at the plates' mass, where several occasions or plates agree that the stated mass is wrong.

    They are not scaled to it. A user who ignores the finding keeps the stated mass.
    """
    for reported in findings:
        if reported.code != _DOUBTED or reported.severity is not Severity.WARNING or not reported.is_open:
            continue
        evidence = (reported.evidence[name] for name in ("mass_by_force_kg", "stated_kg", "agreeing"))
        by_force, stated, agreeing = (
            float(quantity.value) for quantity in evidence if not isinstance(quantity.value, tuple)
        )
        if agreeing >= _FEWEST:
            sd_kg = reported.evidence["mass_by_force_kg"].sd or 0.0
            return prior.at_mass(prior.mass_kg + by_force - stated, max(prior.mass_sd_kg, sd_kg))
    return prior


def at_mass_of_plates(ready: Prepared, fitted: SimultaneousFit) -> Prepared | None:
    """Return the person at the mass that all plates agree on in an estimate.

    None if not all plates contradict the stated mass equally, if something was attached, or if the user ignores it.
    """
    gain = common_gain(fitted.posterior.instrument_errors)
    ignored = any(_DOUBTED.startswith(code) for code in ready.overrule.ignore)
    if gain is None or ignored or ready.attached:
        return None
    return replace(ready, prior=at_common_gain(ready.prior, fitted.bsp.total_mass_kg, gain))


def common_gain(errors: Sequence[CalibrationEntry]) -> tuple[float, float] | None:
    """Return the gain error common to all plates in all trials, with its SD; None if there is none.

    Args:
        errors: of instruments, significant or not.
    """
    gains = [error for error in errors if error.quantity == GAIN]
    gains = [gain for gain in gains if gain.trial is not None] or gains
    informed = [gain for gain in gains if not _uninformed(gain)]
    values = np.array([gain.value for gain in informed])
    if len({gain.plate for gain in informed}) < _FEWEST_PLATES or not all(gain.found for gain in informed):
        return None
    least, most = float(np.abs(values).min()), float(np.abs(values).max())
    mean = float(values.mean())
    if abs(np.sign(values).sum()) < len(values) or least < _ALIKE * most or abs(mean) < _LEAST:
        return None
    return mean, float(np.mean([gain.sd for gain in informed]))


def at_common_gain(prior: BspPrior, total_kg: float, gain: tuple[float, float]) -> BspPrior:
    """Return the prior at the mass for which plates with this common gain error are right.

    `total_kg` is the estimated mass of the body.
    """
    error, sd = gain
    mass_kg = total_kg * (1.0 + error)
    return prior.at_mass(mass_kg, max(prior.mass_sd_kg, sd * mass_kg))


def _uninformed(calibration_entry: CalibrationEntry) -> bool:
    small, wide = _UNINFORMED
    return (
        abs(calibration_entry.value) < small * calibration_entry.prior_sd
        and calibration_entry.sd > wide * calibration_entry.prior_sd
    )
