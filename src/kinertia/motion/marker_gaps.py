"""Fills marker gaps from the model, with the offset that the marker has before and after the gap.

Model and markers differ by millimetres to centimetres (skin, marker placement), so a pose that is fitted to fewer
markers differs: where a marker vanishes for a frame, the joint jumps, and accelerations at the edges of the gap are
hundreds of times those of the body. If a marker in a gap keeps its offset, in the axes of its segment, it has no effect
on the pose, which stays continuous.
"""

import numpy as np

from kinertia.model.skeleton import Skeleton


class GapOffsets:
    """Interpolated marker offsets in the gaps of a trial.

    Args:
        measured: (n, m, 3) m; NaN where not seen.
        placed: (n,) frames that have a pose.
    """

    def __init__(self, measured: np.ndarray, placed: np.ndarray) -> None:
        self._measured = measured
        seen = np.isfinite(measured).all(axis=-1) & placed[:, None]
        frames = np.arange(len(seen))[:, None]
        before = np.maximum.accumulate(np.where(seen, frames, -1), axis=0)
        after = np.minimum.accumulate(np.where(seen, frames, len(seen))[::-1], axis=0)[::-1]
        ever = seen.any(axis=0)
        # before the first and after the last frame that shows a marker, the offset is that of this frame
        self._before = np.where(ever, np.where(before < 0, after, before), 0)
        self._after = np.where(ever, np.where(after >= len(seen), self._before, after), 0)
        self._gap = ~seen & ever & placed[:, None]

    @property
    def frames(self) -> np.ndarray:
        """Frames with a pose that lack a marker visible elsewhere in the trial."""
        return np.flatnonzero(self._gap.any(axis=1))

    def filled(self, model: Skeleton, q: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return the markers (f, m, 3) m of these frames, gaps filled by the poses q (n, c) of all frames."""
        ends = [at[frames] for at in (self._before, self._after)]
        edges = np.unique(np.concatenate([end[self._gap[frames]] for end in ends]))
        local = self._errors(model, q, edges)
        columns = np.arange(self._gap.shape[1])
        first, last = (local[np.minimum(np.searchsorted(edges, end), len(edges) - 1), columns] for end in ends)
        length = np.maximum(ends[1] - ends[0], 1)
        share = np.clip((frames[:, None] - ends[0]) / length, 0.0, 1.0)[..., None]
        pose = model.pose(q[frames])
        turned = pose.rotation[:, model.marker_segments]
        error = (turned @ (first + share * (last - first))[..., None])[..., 0]
        held = model.marker_positions(pose) + error
        result: np.ndarray = np.where(self._gap[frames][..., None], held, self._measured[frames])
        return result

    def _errors(self, model: Skeleton, q: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return measured minus model markers (f, m, 3) m of these frames, in the axes of their segments."""
        pose = model.pose(q[frames])
        turned = pose.rotation[:, model.marker_segments].transpose(0, 1, 3, 2)
        result: np.ndarray = (turned @ (self._measured[frames] - model.marker_positions(pose))[..., None])[..., 0]
        return result
