"""Moves each segment's markers as a rigid cluster, by harmonics of the stride that no joint angle explains.

It contradicts the estimator's model of skin (`kinertia.estimation.simultaneous.markers.skin`) on purpose: displacements
along three axes and rotations about three, each a sum of the stride's first harmonics with random phases. Sizes are
those of `kinertia.synthetic.noise.SkinMotion`. Rotations are as large as displacements at `_ARM_M` from the middle of
the markers.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kinertia.model.skeleton import Skeleton
from kinertia.synthetic.noise import artefact_range
from kinertia.trial.data import Markers

_HARMONICS = np.arange(1.0, 5.0)
_ARM_M = 0.1
STRIDE_S = 1.23
"""Duration of a stride of the package's walk."""


@dataclass(frozen=True, eq=False)
class ClusterMotion:
    """Motion of a person's marker clusters, the same in every trial and stride.

    Attributes:
        waves: segment -> (2, 4, 6) cosines and sines of the harmonics of three displacements, m, and three rotations,
            rad, in the segment's frame.
    """

    waves: Mapping[str, np.ndarray]

    @classmethod
    def draw(cls, skeleton: Skeleton, rng: np.random.Generator) -> Self:
        """Draw random phases; the amplitude of a harmonic is inversely proportional to its number."""
        waves = {}
        phase = 2.0 * np.pi * np.linspace(0.0, 1.0, 100)[:, None] * _HARMONICS
        for segment in dict.fromkeys(marker.segment for marker in skeleton.markers):
            drawn = rng.standard_normal((2, len(_HARMONICS), 6)) / _HARMONICS[:, None]
            path = np.cos(phase) @ drawn[0] + np.sin(phase) @ drawn[1]
            extent = np.linalg.norm(np.ptp(path[:, :3], axis=0))
            scaled = drawn * rng.uniform(*artefact_range(segment)) / extent
            scaled[..., 3:] /= _ARM_M
            waves[segment] = scaled
        return cls(waves)

    def moved(self, markers: Markers, skeleton: Skeleton, q: np.ndarray) -> Markers:
        """Displace the markers of a trial; q (n, c) are its true coordinates at their frames."""
        pose, positions = skeleton.pose(q), markers.positions.copy()
        phase = 2.0 * np.pi * (markers.time / STRIDE_S)[:, None] * _HARMONICS
        for segment, (cosines, sines) in self.waves.items():
            own = [m for m in skeleton.markers if m.segment == segment and m.label in markers.labels]
            columns = [markers.labels.index(marker.label) for marker in own]
            places = np.array([marker.position for marker in own])
            path = np.cos(phase) @ cosines + np.sin(phase) @ sines
            local = path[:, None, :3] + np.cross(path[:, None, 3:], places - places.mean(axis=0))
            turn = pose.rotation[:, None, skeleton.segments.index(segment)]
            positions[:, columns] += (turn @ local[..., None])[..., 0]
        return replace(markers, positions=positions)
