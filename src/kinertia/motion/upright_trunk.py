"""Keeps a trunk with too few markers upright over the pelvis, with the pelvis's average heading.

A walking trunk leans by a few degrees and rotates against the pelvis, so this is known within some 10 degrees. The
trunk is represented by three virtual markers with that uncertainty, so that the ground reactions can correct it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinertia.model.gait27 import ENOUGH_TRUNK_MARKERS, VIRTUAL_TRUNK
from kinertia.model.skeleton import Skeleton
from kinertia.motion.moving_windows import gaussian_mean
from kinertia.trial.data import FloatArray, Markers, Trial

TRUNK_SD_M = 0.08
"""Standard deviation of each coordinate of each marker: 10 degrees."""
_HEADING_S = 0.5


def shows_trunk(skeleton: Skeleton, trial: Trial) -> bool:
    """Decide whether any frame has enough torso markers to determine how it leans and rotates."""
    own = {marker.label for marker in skeleton.markers if marker.segment == "torso"}
    seen = trial.markers.seen[:, [label in own for label in trial.markers.labels]]
    return bool((seen.sum(axis=1) >= ENOUGH_TRUNK_MARKERS).any())


def with_upright_trunk(skeleton: Skeleton, trial: Trial) -> Trial:
    """Add virtual trunk markers to the trial, in the frames that show three markers of the pelvis.

    Args:
        skeleton: of the 27-DOF model, from a static trial.
        trial: facing any way.
    """
    worn = [m for m in skeleton.markers if m.segment == "pelvis" and m.label in trial.markers.labels]
    rotation, translation = rigid_motion(
        np.array([m.position for m in worn]), trial.markers.select([m.label for m in worn]).positions
    )
    joint = next(joint for joint in skeleton.joints if joint.child == "torso")
    lumbar = translation + rotation @ np.asarray(joint.translation)
    upright = _facing(rotation[:, :, 0], trial.markers.rate_hz)
    places = [lumbar + upright @ marker.position for marker in VIRTUAL_TRUNK]
    markers = with_positions(trial.markers, [marker.label for marker in VIRTUAL_TRUNK], np.stack(places, axis=1))
    own = {marker.label: TRUNK_SD_M for marker in VIRTUAL_TRUNK}
    return replace(trial, markers=markers, virtual_sd_m={**trial.virtual_sd_m, **own})


def with_positions(markers: Markers, labels: Sequence[str], positions: FloatArray) -> Markers:
    """Append markers with these positions (n, k, 3) m."""
    return Markers(markers.time, (*markers.labels, *labels), np.concatenate([markers.positions, positions], axis=1))


def rigid_motion(local: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute rotation (n, 3, 3) and translation (n, 3) m that best map points (m, 3) to those measured (n, m, 3).

    NaN where fewer than three are seen (Kabsch 1976).
    """
    seen = np.asarray(np.isfinite(measured).all(axis=2))
    weight = seen[..., None] / np.maximum(seen.sum(axis=1), 1)[:, None, None]
    shown = np.where(seen[..., None], measured, 0.0)
    middle, own = (weight * shown).sum(axis=1), (weight * local).sum(axis=1)
    across = np.einsum("nmi,nmj->nij", weight * (shown - middle[:, None]), local - own[:, None])
    left, _, right = np.linalg.svd(across)
    handed = np.linalg.det(left @ right)
    left[:, :, 2] *= handed[:, None]
    rotation = left @ right
    translation = middle - np.einsum("nij,nj->ni", rotation, own)
    few: np.ndarray = seen.sum(axis=1) < 3
    rotation[few], translation[few] = np.nan, np.nan
    return rotation, translation


def _facing(forward: FloatArray, rate_hz: float) -> FloatArray:
    """Return upright axes (n, 3, 3) that face along directions (n, 3), averaged over about a stride."""
    known = np.asarray(np.isfinite(forward).all(axis=1))
    flat = np.where(known[:, None], forward, 0.0) * [1.0, 0.0, 1.0]
    if len(flat) > 1:
        flat = gaussian_mean(flat, _HEADING_S * rate_hz)
    x = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)
    up = np.tile([0.0, 1.0, 0.0], (len(x), 1))
    return np.stack([x, up, np.cross(x, up)], axis=2)
