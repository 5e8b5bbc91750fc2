"""Are a model's masses and inertias possible?

Mass and inertia alone determine the smallest density that a body can have: that of a uniform sphere with the same mass
and the same sum of second moments. Nothing in a person is denser than bone, at 2000 kg/m3.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.person_context import PersonContext
from kinertia.estimation.estimated_bodies import estimated_bodies
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.bsp import BodySegmentParameters, FloatArray, impossible_segments, second_moments

HEAVY_KG, NEGLIGIBLE_KG = 0.5, 0.1
"""Bodies that are lighter are judged less strictly, or not at all."""
_DENSEST_KG_M3 = 5000.0
"""Heavy bodies of fault-free models are at most at 1300; patellae and other light ones have guesses up to 5600."""
_LARGEST_RADIUS_M = 0.6
"""No part of a person has a larger radius of gyration (a rod of 2 m has 0.58 m)."""
_HEAVIEST_KG, _LIGHTEST_KG = 300.0, 1.0
"""Largest mass that a person may have, and less than a leg of a child."""
_NO_EXTENT_M = 1e-4
"""Root mean square distance of the mass from its centre below which there is no inertia."""


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
                dense = Quantity(density, "kg/m3", limit=_DENSEST_KG_M3, usual=(0.0, 1300.0))
                yield finding("O203", Where(part=name), density_kg_m3=dense)
        gyration_m = float(np.sqrt(max(inertia.diagonal().max(), 0.0) / mass_kg)) if mass_kg > 0 else 0.0
        if gyration_m > _LARGEST_RADIUS_M:
            severity = of_body(context, name, Severity.ERROR if mass_kg >= NEGLIGIBLE_KG else Severity.WARNING)
            large = Quantity(gyration_m, "m", limit=_LARGEST_RADIUS_M)
            yield finding("O204", Where(part=name), severity, radius_m=large, mass_kg=Quantity(mass_kg, "kg"))


def mass_unit(context: PersonContext) -> Iterator[Finding]:
    """Report O206: a model that weighs more than any person, or next to nothing."""
    if context.model is None:
        return
    model_kg = context.model.bsp.total_mass_kg
    if model_kg > _HEAVIEST_KG or 0.0 < model_kg < _LIGHTEST_KG:
        limit_kg = _HEAVIEST_KG if model_kg > _HEAVIEST_KG else _LIGHTEST_KG
        yield finding("O206", model_kg=Quantity(model_kg, "kg", limit=limit_kg))


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
