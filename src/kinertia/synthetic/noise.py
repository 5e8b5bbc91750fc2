"""Adds measurement errors to synthetic trials: skin motion, cameras, force plates; each has its own random generator.

Markers: the study's sinusoids (`study_noise`), a soft-tissue artefact that moves with the neighbouring joints
(`SkinMotion`), and white camera noise (`camera_noise`). Plates: white noise and a constant offset
(`plate_noise`).

It contradicts the estimator's model of skin (`kinertia.estimation.simultaneous.markers.skin`) on purpose: displacements
along three axes and rotations about three, each a sum of the stride's first harmonics with random phases. Sizes are
those of `kinertia.synthetic.noise.SkinMotion`. Rotations are as large as displacements at `_ARM_M` from the middle of
the markers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kinertia.model.skeleton import Skeleton
from kinertia.model.skin_angles import skin_angles
from kinertia.trial.data import LOAD_THRESHOLD_N, Markers, PlateLoads

STUDY_AMPLITUDE_M, STUDY_RATE_RAD_S = 0.01, 25.0
ARTEFACT_RANGE_M = {"thigh": (0.010, 0.018), "shank": (0.007, 0.017)}
"""Peak-to-peak displacement over a step, m, by segment; other segments: `OTHER_ARTEFACT_RANGE_M`."""
OTHER_ARTEFACT_RANGE_M = (0.004, 0.009)
_HARMONICS = np.arange(1.0, 5.0)
_ARM_M = 0.1
STRIDE_S = 1.23
"""Duration of a stride of the package's walk."""


def study_noise(markers: Markers, rng: np.random.Generator) -> Markers:
    """Add the study's noise: A sin(w t + phi) on every marker coordinate.

    Uniform 0 <= A <= 1 cm, 0 <= w <= 25 rad/s, 0 <= phi <= 2 pi, drawn once per marker coordinate and trial. 4.1 mm
    RMS, below 4 Hz: no low-pass filter removes it (Chèze et al. 1995).
    """
    return displaced(markers, markers.positions.shape[1:], rng)


def displaced(
    markers: Markers, shape: tuple[int, int], rng: np.random.Generator, most_rad_s: float = STUDY_RATE_RAD_S
) -> Markers:
    """Move the markers by sinusoids of the study's amplitudes and phases.

    Args:
        markers: m of them.
        shape: number of sinusoids drawn: (m, 3) one per coordinate, (m, 1) one per marker, (1, 3) one per axis.
        rng: of amplitudes, rates and phases, in this order.
        most_rad_s: rates are uniform from 0 to this.
    """
    amplitude = rng.uniform(0.0, STUDY_AMPLITUDE_M, shape)
    rate = rng.uniform(0.0, most_rad_s, shape)
    phase = rng.uniform(0.0, 2 * np.pi, shape)
    time = (markers.time - markers.time[0])[:, None, None]
    return replace(markers, positions=markers.positions + amplitude * np.sin(rate * time + phase))


def artefact_range(segment: str) -> tuple[float, float]:
    """Return the smallest and largest peak-to-peak displacement (m) of a segment's markers over a step."""
    return ARTEFACT_RANGE_M.get(segment.rpartition("_")[0], OTHER_ARTEFACT_RANGE_M)


@dataclass(frozen=True, eq=False)
class SkinMotion:
    """Skin motion that follows the joints, the same in all trials of a person.

    Each segment's markers move together, linearly in the angles of the joints at its two ends. Form after Camomilla et
    al. (2013) and Bonci et al. (2014); magnitudes from the review of Peters et al. (2010).

    Attributes:
        slopes: segment -> (k, 3) m/rad in the segment's frame, per angle of its joints.
        reference: (c,) coordinates without displacement.
    """

    slopes: Mapping[str, np.ndarray]
    reference: np.ndarray

    @classmethod
    def draw(
        cls, skeleton: Skeleton, q: np.ndarray, rng: np.random.Generator, others: Sequence[np.ndarray] = ()
    ) -> Self:
        """Draw random directions per joint angle, and peak-to-peak sizes over the coordinates q (n, c) of a walk.

        Sizes are from `ARTEFACT_RANGE_M`: 10-18 mm on the thigh, 7-17 mm on the shank, 4-9 mm elsewhere; less where the
        person's other motions (each n, c) would displace the skin more than twice as far (no source).
        """
        reference, slopes, every = q.mean(axis=0), {}, np.concatenate([q, *others])
        for segment in skeleton.segments:
            if not any(marker.segment == segment for marker in skeleton.markers):
                continue
            columns = skin_angles(skeleton, segment)
            directions = rng.standard_normal((len(columns), 3))
            low, high = artefact_range(segment)
            walking, overall = (np.linalg.norm(np.ptp(each[:, columns] @ directions, axis=0)) for each in (q, every))
            extent = max(walking, overall / 2.0)
            slopes[segment] = directions * (rng.uniform(low, high) / extent if extent > 0 else 0.0)
        return cls(slopes, reference)

    def moved(self, markers: Markers, skeleton: Skeleton, q: np.ndarray) -> Markers:
        """Displace the markers of a trial; q (n, c) are its true coordinates at their frames."""
        pose = skeleton.pose(q)
        positions = markers.positions.copy()
        for segment, slopes in self.slopes.items():
            labels = [marker.label for marker in skeleton.markers if marker.segment == segment]
            columns = [markers.labels.index(label) for label in labels if label in markers.labels]
            local = (q - self.reference)[:, skin_angles(skeleton, segment)] @ slopes
            turned = pose.rotation[:, skeleton.segments.index(segment)] @ local[..., None]
            positions[:, columns] += turned[:, None, :, 0]
        return replace(markers, positions=positions)


def camera_noise(markers: Markers, sd_m: float, rng: np.random.Generator) -> Markers:
    """Add white noise of this standard deviation (m) to every marker coordinate and frame."""
    return replace(markers, positions=markers.positions + rng.normal(0.0, sd_m, markers.positions.shape))


def plate_noise(
    plates: PlateLoads, force_sd_n: float, offset_sd_n: float, moment_sd_nm: float, rng: np.random.Generator
) -> PlateLoads:
    """Add white noise to forces (N) and moments (N m), and a constant force offset (N) per plate, on loaded samples.

    Force errors act at the middle of the plate's corners (at the ground origin if they are unknown). Samples below the
    load threshold are zero, as from the readers of this package.
    """
    shape = plates.force.shape
    offset = rng.normal(0.0, offset_sd_n, (1, *shape[1:]))
    error = rng.normal(0.0, force_sd_n, shape) + offset
    centre = np.zeros(3) if plates.corners is None else plates.corners.mean(axis=1)
    force = plates.force + error
    moment = plates.moment + np.cross(centre, error) + rng.normal(0.0, moment_sd_nm, shape)
    loaded = (plates.force[..., 1:2] > 0) & (force[..., 1:2] >= LOAD_THRESHOLD_N)
    return replace(plates, force=np.where(loaded, force, 0.0), moment=np.where(loaded, moment, 0.0))


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
