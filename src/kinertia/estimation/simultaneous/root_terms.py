"""The root equations at some frames of a trial, linearised and over their deviations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.simultaneous.layout import Layout
from kinertia.estimation.simultaneous.normal_equations import RootTerms
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.log_cholesky import dynamic_jacobian
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, axis_motion
from kinertia.motion.root_columns import Columns, root_columns


def root_terms(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    theta: np.ndarray,
    motion: Motion,
    wrench: np.ndarray,
    by_static: np.ndarray,
    sd: np.ndarray,
    columns: Columns,
    frames: np.ndarray,
) -> RootTerms:
    """Residuals and derivatives at d frames.

    Args:
        skeleton: freed, with all coordinates.
        bsp: body segment parameters, and
        theta: (10 b,) the unknowns that they are made from.
        motion: of all coordinates.
        wrench: (d, 6) sum of the ground reactions at the ground origin: N, N m.
        by_static: (d, 6, s) its derivatives by the static unknowns that root equations depend on; written.
        sd: (d, 6) deviations of the residuals.
        columns: `columns_of` the problem.
        frames: (d,) indices.
    """
    root = np.ascontiguousarray(skeleton.root.centre(motion.q)), skeleton.root.moves
    left, (q, qd, qdd) = root_columns(
        skeleton.tree,
        skeleton.gravity_m_s2,
        skeleton.bodies(bsp),
        axis_motion(skeleton, motion),
        skeleton.map.bends(motion.q, motion.qd, motion.qdd),
        root,
        wrench,
        dynamic_jacobian(theta),
        sd,
        columns,
        by_static,
    )
    return RootTerms(frames, q, qd, qdd, by_static, left)


def columns_of(
    skeleton: Skeleton, segments: Sequence[str], moving: np.ndarray, still: np.ndarray, layout: Layout
) -> Columns:
    """Where the derivatives go, of these segments' parameters and of coordinates of a freed skeleton: indices of those
    that move, and of those that do not.
    """
    to_moving, to_still = np.full((2, len(skeleton.coordinates)), -1)
    to_moving[moving] = np.arange(len(moving))
    to_still[still] = np.arange(layout.coordinates.start, layout.coordinates.stop)
    owner = skeleton.map.owner
    rows = np.array([skeleton.segments.index(segment) for segment in segments])
    instruments = layout.instruments
    return Columns(to_moving[owner], to_still[owner], rows, len(moving), instruments.start, instruments.stop)
