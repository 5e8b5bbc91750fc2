"""Are a model's masses and inertias possible, and plausible: measured, like the tables, symmetrical, this person's?

Mass and inertia alone determine the smallest density that a body can have: that of a uniform sphere with the same mass
and the same sum of second moments. Nothing in a person is denser than bone, at 2000 kg/m3.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import PersonContext
from kinertia.diagnostics.model.mass_table import (
    SIDE_COM_M,
    SIDE_MASS,
    SIDE_MOMENT,
    ModelCheck,
    check_model,
    side_differences,
)
from kinertia.diagnostics.runner import check
from kinertia.diagnostics.subject.mass import ERROR_SHARE, WARNING_SHARE
from kinertia.estimation.prepared import estimated_bodies
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters, FloatArray, impossible_segments, second_moments

HEAVY_KG, NEGLIGIBLE_KG = Limit(0.5, "kg"), Limit(0.1, "kg")
"""Bodies that are lighter are judged less strictly, or not at all."""
_DENSEST_KG_M3 = Limit(5000.0, "kg/m3", usual=(0.0, 1300.0))
"""Heavy bodies of fault-free models are at most at 1300; patellae and other light ones have guesses up to 5600."""
_LARGEST_RADIUS_M = Limit(0.6, "m")
"""No part of a person has a larger radius of gyration (a rod of 2 m has 0.58 m)."""
_HEAVIEST_KG, _LIGHTEST_KG = Limit(300.0, "kg"), Limit(1.0, "kg")
"""Largest mass that a person may have, and less than a leg of a child."""
_NO_EXTENT_M = 1e-4
"""Root mean square distance of the mass from its centre below which there is no inertia."""
_ARMS_IN_TORSO = Limit(0.42, usual=(0.25, 0.32))
"""Torso's moment about its long axis over the mean of the other two: 0.25-0.32 in the literature for the torso with the
head, 0.5 where the arms hang beside it and are counted in (gait2354, whose torso the models with arms took over: a
known problem of the models of Hamner 2010 and Rajagopal 2016)."""
_OUTLYING_SD = Limit(2.0)


@check("O201")
def impossible_inertia(context: PersonContext) -> Iterator[Finding]:
    """Report O201: bodies whose inertia no distribution of mass can have."""
    if context.model is None:
        return
    bsp = context.model.bsp
    violated: dict[str, list[str]] = {name: [] for name in impossible_segments(bsp)}
    for name, condition in (sentence.rstrip(".").split(": ", 1) for sentence in bsp.inconsistencies()):
        if name in violated:
            violated[name].append(condition)
    smallest = np.linalg.eigvalsh(second_moments(bsp.inertia_kgm2))[:, 0]
    for name, conditions in violated.items():
        excess = Quantity(max(-2.0 * float(smallest[bsp.segments.index(name)]), 0.0), "kg m2")
        severity = of_body(context, name, Severity.ERROR)
        yield finding("O201", Where(part=name), severity, excess_kgm2=excess, condition=Quantity("; ".join(conditions)))


@check("O202", heavy=HEAVY_KG)
def missing_inertia(context: PersonContext) -> Iterator[Finding]:
    """Report O202: mass without inertia, or with a negative one, as if all of it were in a point."""
    if context.model is None:
        return
    bsp, estimated = context.model.bsp, _estimated(context)
    for name, mass_kg, radius_m in _radii(bsp):
        if mass_kg > 0 and not radius_m > _NO_EXTENT_M:
            light = mass_kg < HEAVY_KG and (not context.has_trials or name not in estimated)
            severity = of_body(context, name, Severity.WARNING if light else Severity.ERROR)
            radius = Quantity(max(radius_m, 0.0), "m", limit=_NO_EXTENT_M)
            yield finding("O202", Where(part=name), severity, mass_kg=Quantity(mass_kg, "kg"), radius_m=radius)


@check("O203", "O204", density=_DENSEST_KG_M3, radius=_LARGEST_RADIUS_M, negligible=NEGLIGIBLE_KG)
def inertia_size(context: PersonContext) -> Iterator[Finding]:
    """Report O203: bodies denser than anything in a person; O204: bodies larger than a person."""
    if context.model is None:
        return
    bsp = context.model.bsp
    for (name, mass_kg, spread_m), inertia in zip(_radii(bsp), bsp.inertia_kgm2, strict=True):
        if mass_kg >= HEAVY_KG and spread_m > _NO_EXTENT_M:
            radius_m = spread_m * np.sqrt(5.0 / 3.0)  # a sphere's mean square distance is 3/5 of its radius squared
            density = float(mass_kg / (4.0 / 3.0 * np.pi * radius_m**3))
            if density > _DENSEST_KG_M3:
                dense = Quantity(density, "kg/m3", limit=_DENSEST_KG_M3, usual=_DENSEST_KG_M3.usual)
                yield finding("O203", Where(part=name), density_kg_m3=dense)
        gyration_m = float(np.sqrt(max(inertia.diagonal().max(), 0.0) / mass_kg)) if mass_kg > 0 else 0.0
        if gyration_m > _LARGEST_RADIUS_M:
            severity = of_body(context, name, Severity.ERROR if mass_kg >= NEGLIGIBLE_KG else Severity.WARNING)
            large = Quantity(gyration_m, "m", limit=_LARGEST_RADIUS_M)
            yield finding("O204", Where(part=name), severity, radius_m=large, mass_kg=Quantity(mass_kg, "kg"))


@check("O206", heaviest=_HEAVIEST_KG, lightest=_LIGHTEST_KG)
def mass_unit(context: PersonContext) -> Iterator[Finding]:
    """Report O206: a model that weighs more than any person, or next to nothing."""
    if context.model is None:
        return
    model_kg = context.model.bsp.total_mass_kg
    if model_kg > _HEAVIEST_KG or 0.0 < model_kg < _LIGHTEST_KG:
        limit_kg = _HEAVIEST_KG if model_kg > _HEAVIEST_KG else _LIGHTEST_KG
        yield finding("O206", model_kg=Quantity(model_kg, "kg", limit=limit_kg))


@check("O205")
def degenerate_inertia(context: PersonContext) -> Iterator[Finding]:
    """Report O205: two principal moments that add up to the third exactly, as rounded ones do: a body without
    thickness."""
    if context.model is None:
        return
    bsp = context.model.bsp
    others = {*impossible_segments(bsp), *(name for name, _, radius_m in _radii(bsp) if not radius_m > _NO_EXTENT_M)}
    for k in np.flatnonzero(~bsp.physically_consistent() & (bsp.mass_kg > 0)):
        name = bsp.segments[k]
        if name not in others:
            moments = Quantity(tuple(np.linalg.eigvalsh(bsp.inertia_kgm2[k]).tolist()), "kg m2")
            yield finding("O205", Where(part=name), advice(context), moments_kgm2=moments)


def of_body(context: PersonContext, name: str, severity: Severity) -> Severity:
    """Return INFO for a body that a fit does not estimate, else the severity as it is."""
    return severity if name in _estimated(context) else Severity.INFO


def advice(context: PersonContext) -> Severity:
    """Return the severity of advice: a fit takes the model's parameters as a prior only, a simulation as they are."""
    return Severity.INFO if context.has_trials else Severity.WARNING


def _estimated(context: PersonContext) -> set[str]:
    """Return the bodies whose parameters a fit would estimate; all of a model that is checked on its own."""
    assert context.model is not None
    model = context.model
    return estimated_bodies(model.skeleton, model.bsp) if context.has_trials else set(model.bsp.segments)


def _radii(bsp: BodySegmentParameters) -> list[tuple[str, float, float]]:
    """List name, mass (kg) and RMS distance (m) of the mass from its centre; negative where the inertia is."""
    second: FloatArray = np.trace(second_moments(bsp.inertia_kgm2), axis1=1, axis2=2)
    square = second / np.where(bsp.mass_kg > 0, bsp.mass_kg, np.inf)
    radii = np.sign(square) * np.sqrt(np.abs(square))
    return list(zip(bsp.segments, bsp.mass_kg.tolist(), radii.tolist(), strict=True))


@check("O211")
def placeholders(context: PersonContext) -> Iterator[Finding]:
    """Report O211: placeholder inertias that were never measured: three equal moments, or moments of at most two
    digits."""
    if context.model is None:
        return
    bsp = context.model.bsp
    for name, mass_kg, inertia in zip(bsp.segments, bsp.mass_kg, bsp.inertia_kgm2, strict=True):
        moments = inertia.diagonal()
        if not mass_kg > 0 or not moments.any():
            continue
        if np.ptp(moments) <= 1e-6 * moments.max():
            pattern = "three equal"
        elif all(float(f"{value:.1e}") == value for value in moments):
            pattern = "rounded"
        else:
            continue
        values = Quantity(tuple(moments.tolist()), "kg m2")
        yield finding("O211", Where(part=name), advice(context), moments_kgm2=values, pattern=Quantity(pattern))


@check("O212", distance=_OUTLYING_SD)
def unlike_tables(context: PersonContext) -> Iterator[Finding]:
    """Report O212: the parameter of each segment farthest from both tables, if farther than people are; a model that is
    fitted is compared at the mass to which the fit scales it.
    """
    check = _checked(context)
    if check is None or not check.literature:
        return
    for name, row in zip(check.segments.bsp.segments, check.segments.bsp.table(), strict=True):
        tables = np.array([table[name] for table in check.literature.values()])
        low, high = tables.min(axis=0), tables.max(axis=0)
        beyond = np.nan_to_num(np.maximum(low - row, row - high) / check.spread[name])[:7]
        k = int(np.argmax(beyond))
        if beyond[k] <= _OUTLYING_SD:
            continue
        unit = "kg" if k == 0 else "m" if k < 4 else "kg m2"
        bodies = check.segments.bodies[name]
        yield finding(
            "O212",
            Where(part=bodies[0] if len(bodies) == 1 else name),
            advice(context),
            value=Quantity(float(row[k]), unit),
            table_low=Quantity(float(low[k]), unit),
            table_high=Quantity(float(high[k]), unit),
            distance_sd=Quantity(float(beyond[k]), "1", limit=_OUTLYING_SD),
            parameter=Quantity(PARAMETERS[k]),
        )


@check("O213", share=WARNING_SHARE, error=ERROR_SHARE)
def model_mass(context: PersonContext) -> Iterator[Finding]:
    """Report O213: a model mass that differs from the person's. A fit scales the masses, so that only a difference
    larger than between people is reported there; legs alone cannot be scaled to the whole body's mass.
    """
    stated_kg = None if context.total_mass is None else context.total_mass.body_kg
    stated_kg = context.subject.mass_kg if stated_kg is None else stated_kg
    if context.model is None or stated_kg is None:
        return
    model_kg = context.model.bsp.total_mass_kg
    off = abs(model_kg / stated_kg - 1.0)
    if off <= (ERROR_SHARE if context.has_trials else WARNING_SHARE):
        return
    bsp = context.model.bsp
    trunk_kg = sum(kg for name, kg in zip(bsp.segments, bsp.mass_kg, strict=True) if segment_of(name) == "torso")
    scaled = context.has_trials and (trunk_kg > 0 or model_kg > stated_kg)
    severity = Severity.ERROR if off > ERROR_SHARE and not scaled else Severity.WARNING
    limit = stated_kg * (1.0 + (WARNING_SHARE if model_kg > stated_kg else -WARNING_SHARE))
    yield finding(
        "O213", None, severity, model_kg=Quantity(model_kg, "kg", limit=limit), stated_kg=Quantity(stated_kg, "kg")
    )


@check("O214", mass=SIDE_MASS, com=SIDE_COM_M, moment=SIDE_MOMENT)
def sides(context: PersonContext) -> Iterator[Finding]:
    """Report O214: pairs of bodies that do not mirror each other."""
    if context.model is None:
        return
    for difference in side_differences(context.model.bsp):
        yield finding(
            "O214",
            Where(part=difference.body),
            advice(context),
            mass_share=Quantity(difference.mass_share, "1", limit=SIDE_MASS),
            com_m=Quantity(difference.com_m, "m", limit=SIDE_COM_M),
            moment_share=Quantity(difference.moment_share, "1", limit=SIDE_MOMENT),
        )


@check("O215", ratio=_ARMS_IN_TORSO)
def arms_in_torso(context: PersonContext) -> Iterator[Finding]:
    """Report O215: a torso with the arms' inertia in a model whose arms are bodies of their own."""
    if context.model is None:
        return
    check = check_model(context.model.skeleton, context.model.bsp)
    segments = check.segments
    if not check.has_arms or "torso" not in segments.bodies:
        return
    moments = segments.bsp.inertia_kgm2[segments.bsp.segments.index("torso")].diagonal()
    others = moments[[0, 2]].mean()
    ratio = float(moments[1] / others) if others > 0 else 0.0
    if ratio > _ARMS_IN_TORSO:
        bodies = segments.bodies["torso"]
        yield finding(
            "O215",
            Where(part=bodies[0] if len(bodies) == 1 else "torso"),
            advice(context),
            ratio=Quantity(ratio, "1", limit=_ARMS_IN_TORSO, usual=_ARMS_IN_TORSO.usual),
        )


@check("O415")
def compared_with_tables(context: PersonContext) -> Iterator[Finding]:
    """Report O415: what was not compared in a model that is checked on its own, and why."""
    if context.model is None or context.has_trials:
        return
    subject = context.subject
    stated = (("mass_kg", "mass"), ("height_m", "stature"), ("sex", "sex"))
    wanted = [name for field, name in stated if getattr(subject, field) is None]
    check = check_model(context.model.skeleton, context.model.bsp)
    reasons = [f"{' and '.join(wanted)} not stated"] if wanted else []
    if check.segments.geometry is None:
        reasons.append("a joint of the trunk or legs could not be identified from the names of the bodies")
    if not check.has_arms:
        reasons.append("it has no arms, so of the torso only the mass was compared, with the tables' torso and arms")
    if check.segments.unknown:
        reasons.append(f"no segment is known for {', '.join(check.segments.unknown)}")
    if reasons:
        yield finding("O415", reason=Quantity("; ".join(reasons)))


def _checked(context: PersonContext) -> ModelCheck | None:
    """Return the model next to the tables; None where the person is not known well enough."""
    subject, model = context.subject, context.model
    if model is None or subject.height_m is None or subject.sex is None:
        return None
    bsp, mass_kg = model.bsp, subject.mass_kg if context.total_mass is None else context.total_mass.body_kg
    if context.has_trials and mass_kg is not None:
        factor = mass_kg / bsp.total_mass_kg
        bsp = BodySegmentParameters(bsp.segments, factor * bsp.mass_kg, bsp.com_m, factor * bsp.inertia_kgm2)
    return check_model(model.skeleton, bsp, mass_kg, subject.height_m, subject.sex)
