"""What speaks against a model before any measurement: one list for `check` and for every fit with an OpenSim model."""

from __future__ import annotations

from kinertia.diagnostics.model.density import dense_doubts
from kinertia.diagnostics.model.mirrored_joints import mirrored_joints_doubts
from kinertia.diagnostics.model.subtalar_axis import subtalar_axis_doubts
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton


def model_doubts(skeleton: Skeleton, bsp: BodySegmentParameters) -> list[str]:
    """One sentence for each doubt: what, with its evidence, the likeliest cause and what to do.

    Args:
        skeleton: of the model as it was read.
        bsp: of its bodies.
    """
    return [*dense_doubts(bsp), *mirrored_joints_doubts(skeleton), *subtalar_axis_doubts(skeleton)]
