"""Selects the bodies of an OpenSim model that are estimated; the others keep the parameters of the model."""

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton

LIGHT_KG = 0.5
"""Groups of bodies with less total mass than this move with their joints, but are not estimated."""


def estimated_bodies(skeleton: Skeleton, own: BodySegmentParameters) -> set[str]:
    """Select the heaviest body of every group that moves as one; none of a group lighter than `LIGHT_KG` in total.

    Args:
        skeleton: with the coordinates locked that no marker determines.
        own: the model's own parameters, at the mass of the person.
    """
    mass = dict(zip(own.segments, own.mass_kg, strict=True))
    groups: dict[int, list[str]] = {}
    carrier_of = dict(zip(skeleton.segments, skeleton.tree.carrier.tolist(), strict=True))
    for name in own.segments:
        groups.setdefault(carrier_of[name], []).append(name)
    heavy = [names for names in groups.values() if sum(mass[name] for name in names) >= LIGHT_KG]
    return {max(names, key=mass.__getitem__) for names in heavy}
