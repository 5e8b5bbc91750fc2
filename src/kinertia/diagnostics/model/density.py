"""How dense a body must at least be, by its mass and inertia alone: finds inertias that are missing or too small.

Of all bodies of one density with the same mass and the same sum of second moments, the sphere is the largest. Its
density is therefore the smallest that the body can have: nothing in a person is denser than bone, at 2000 kg/m3.
"""

from __future__ import annotations

import numpy as np

from kinertia.model.bsp import BodySegmentParameters, FloatArray, second_moments

DENSEST_KG_M3 = 5000.0
"""Heavy bodies of sound models are at most at 1300; patellae and other light ones have guesses up to 5600."""
HEAVY_KG = 0.5
"""Lighter bodies are not judged."""
_NO_EXTENT_M = 1e-4
"""Root mean square distance of the mass from its centre below which there is no inertia."""


def points(bsp: BodySegmentParameters) -> list[str]:
    """Bodies with mass and without inertia, or with a negative one: all of their mass would be in a point."""
    spread = _spread_m2(bsp)
    with_mass = zip(bsp.segments, bsp.mass_kg, spread, strict=True)
    return [name for name, mass, square in with_mass if mass > 0 and not square > _NO_EXTENT_M**2]


def dense_doubts(bsp: BodySegmentParameters) -> list[str]:
    """One sentence on the heavy bodies with inertia that would have to be denser than anything in a person, if any."""
    dense = _too_dense(bsp)
    if not dense:
        return []
    listed = ", ".join(f"{name} ({density / 1e3:.0f} times)" for name, density in dense.items())
    return [
        f"moments of inertia too small for the mass: these bodies would have to be denser than water by the factor in "
        f"brackets, and bone is by 2: {listed}; most likely inertias in another unit (expected kg m2), or placeholders"
    ]


def _too_dense(bsp: BodySegmentParameters) -> dict[str, float]:
    """Bodies by name, and their density (kg/m3)."""
    dense = {}
    for name, mass, square in zip(bsp.segments, bsp.mass_kg, _spread_m2(bsp), strict=True):
        if mass < HEAVY_KG or not square > _NO_EXTENT_M**2:
            continue
        radius = np.sqrt(square * 5.0 / 3.0)  # a sphere's mean square distance is 3/5 of its radius squared
        density = float(mass / (4.0 / 3.0 * np.pi * radius**3))
        if density > DENSEST_KG_M3:
            dense[name] = density
    return dense


def _spread_m2(bsp: BodySegmentParameters) -> FloatArray:
    """(s,) mean square distance of the mass from its centre, m2; 0 without mass."""
    second = np.trace(second_moments(bsp.inertia_kgm2), axis1=1, axis2=2)
    spread: FloatArray = second / np.where(bsp.mass_kg > 0, bsp.mass_kg, np.inf)
    return spread
