"""Are a model's masses and inertias plausible: measured, like the tables, symmetrical, and this person's?"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.model.mass_properties import advice
from kinertia.diagnostics.model.model_check import (
    SIDE_COM_M,
    SIDE_MASS,
    SIDE_MOMENT,
    ModelCheck,
    check_model,
    side_differences,
)
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.subject.mass import ERROR_SHARE, WARNING_SHARE
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.anatomy import segment_of
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters

_ARMS_IN_TORSO = 0.42
"""Torso's moment about its long axis over the mean of the other two: 0.25-0.32 in the literature for the torso with the
head, 0.5 where the arms hang beside it and are counted in (gait2354, whose torso the models with arms took over: a
known problem of the models of Hamner 2010 and Rajagopal 2016)."""
_OUTLYING_SD = 2.0


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


def sides(context: PersonContext) -> Iterator[Finding]:
    """Report O214: pairs of bodies that do not mirror each other."""
    if context.model is None:
        return
    for one in side_differences(context.model.bsp):
        yield finding(
            "O214",
            Where(part=one.body),
            advice(context),
            mass_share=Quantity(one.mass_share, "1", limit=SIDE_MASS),
            com_m=Quantity(one.com_m, "m", limit=SIDE_COM_M),
            moment_share=Quantity(one.moment_share, "1", limit=SIDE_MOMENT),
        )


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
            ratio=Quantity(ratio, "1", limit=_ARMS_IN_TORSO, usual=(0.25, 0.32)),
        )


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
