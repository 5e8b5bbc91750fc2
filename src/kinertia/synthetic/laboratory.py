"""Measures a synthetic trial as a laboratory would: skin, cameras and plates with errors, and files.

The plates measure one right and one left contact; the steps before and after are not measured, as in a real laboratory.

Markers: the study's sinusoids (`study_noise`), a soft-tissue artefact that moves with the neighbouring joints
(`SkinMotion`), and white camera noise (`camera_noise`). Plates: white noise and a constant offset
(`plate_noise`).

It contradicts the estimator's model of skin (`kinertia.estimation.simultaneous.markers.skin`) on purpose: displacements
along three axes and rotations about three, each a sum of the stride's first harmonics with random phases. Sizes are
those of `SkinMotion`. Rotations are as large as displacements at `_ARM_M` from the middle of the markers.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Self

import numpy as np
import pandas as pd

from kinertia.errors import TrialError
from kinertia.io.output_folder import complete_folder
from kinertia.io.text.sto import write_sto
from kinertia.io.text.trc import write_trc
from kinertia.model.skeleton import Skeleton, skin_angles
from kinertia.synthetic.walk import HEIGHT_M, MASS_KG, SEX, SyntheticSubject, SyntheticTrial
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, Markers, PlateLoads, Recording
from kinertia.trial.ground_contact import centre_of_pressure
from kinertia.trial.sampled_data import runs

PLATE_SIZE_M = (0.6, 0.4)
"""Length along the walk and width of a force plate."""
STUDY_AMPLITUDE_M, STUDY_RATE_RAD_S = 0.01, 25.0
ARTEFACT_RANGE_M = {"thigh": (0.010, 0.018), "shank": (0.007, 0.017)}
"""Peak-to-peak displacement over a step, m, by segment; other segments: `OTHER_ARTEFACT_RANGE_M`."""
OTHER_ARTEFACT_RANGE_M = (0.004, 0.009)
_HARMONICS = np.arange(1.0, 5.0)
_ARM_M = 0.1
STRIDE_S = 1.23
"""Duration of a stride of the package's walk."""


@dataclass(frozen=True)
class LabNoise:
    """Measurement errors; the defaults are those of a careful laboratory.

    Attributes:
        skin: "artefact": moves with the joints, published magnitudes (`noise.SkinMotion`); "study": the
            study's sinusoids (`noise.study_noise`); "none".
        camera_sd_m: white noise of every marker coordinate, m.
        force_sd_n: white noise of every force component, N.
        force_offset_sd_n: standard deviation of each plate's constant force offset, N.
        moment_sd_nm: white noise of every moment component, N m.
        delay_s: delay of the forces relative to the markers.
        gain: the second plate reads too much, by this share.
    """

    skin: Literal["artefact", "study", "none"] = "artefact"
    camera_sd_m: float = 0.0005
    force_sd_n: float = 1.0
    force_offset_sd_n: float = 1.0
    moment_sd_nm: float = 0.2
    delay_s: float = 0.0
    gain: float = 0.0


PERFECT = LabNoise("none", 0.0, 0.0, 0.0, 0.0)
"""No errors at all."""


@dataclass(frozen=True, eq=False)
class LabRecordings:
    """Recordings of the laboratory: the person standing, and the walk with two force plates."""

    static: Recording
    walk: Recording


def record(
    subject: SyntheticSubject,
    trial: SyntheticTrial,
    noise: LabNoise,
    rng: np.random.Generator,
    samples_per_frame: int = 1,
) -> LabRecordings:
    """Measure a subject and a trial.

    Args:
        subject: the person; its static trial is measured by the same cameras.
        trial: at the plates' rate.
        noise: of skin, cameras and plates.
        rng: the random generator.
        samples_per_frame: samples of the plates to one frame of the cameras.

    Raises:
        TrialError: the trial does not contain one whole contact of each foot.
    """
    samples = len(trial.time) // samples_per_frame * samples_per_frame
    seen = slice(0, samples, samples_per_frame)
    exact = Markers(trial.time[seen], trial.markers.labels, trial.markers.positions[seen])
    moved = exact
    if noise.skin == "artefact":
        q = trial.motion.q[seen]
        moved = SkinMotion.draw(trial.skeleton, q, rng).moved(exact, trial.skeleton, q)
    elif noise.skin == "study":
        moved = study_noise(exact, rng)
    loads = _misread(_plates(trial, samples), noise.delay_s, noise.gain)
    plates = plate_noise(loads, noise.force_sd_n, noise.force_offset_sd_n, noise.moment_sd_nm, rng)
    standing = camera_noise(subject.static.markers, noise.camera_sd_m, rng)
    return LabRecordings(
        Recording("static", standing, None, MASS_KG, HEIGHT_M),
        Recording("walk", camera_noise(moved, noise.camera_sd_m, rng), plates, MASS_KG, HEIGHT_M),
    )


def _plates(trial: SyntheticTrial, samples: int) -> PlateLoads:
    """Put two plates under two whole, overlapping contacts of different feet, nearest to the middle of the trial."""
    caught = _contacts(trial, samples)
    force, moment, corners = np.zeros((samples, 2, 3)), np.zeros((samples, 2, 3)), []
    for p, (foot, first, last) in enumerate(caught):
        piece = slice(first, last + 1)
        force[piece, p], moment[piece, p] = np.split(trial.foot_loads[piece, foot], 2, axis=1)
        pressure = centre_of_pressure(trial.foot_loads[piece, foot])
        middle = (pressure.min(axis=0) + pressure.max(axis=0)) / 2
        half = np.array(PLATE_SIZE_M) / 2
        signs = np.array([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]])
        corners.append(middle + signs * [half[0], 0.0, half[1]])
    names = tuple(f"{p}_ground_force" for p in (1, 2))
    return PlateLoads(trial.time[:samples], names, force, moment, (None, None), np.array(corners))


def _misread(plates: PlateLoads, delay_s: float, gain: float) -> PlateLoads:
    """Delay all loads by whole samples; let the second plate read too much."""
    late = round(delay_s / float(plates.time[1] - plates.time[0]))
    factor = np.array([[1.0], [1.0 + gain]])
    force, moment = (factor * np.roll(values, late, axis=0) for values in (plates.force, plates.moment))
    return replace(plates, force=force, moment=moment)


def _contacts(trial: SyntheticTrial, samples: int) -> list[tuple[int, int, int]]:
    """Return foot (0 right, 1 left), first and last sample of the two contacts, in order of time."""
    whole = [
        (foot, first, last)
        for foot in range(len(FEET))
        for first, last in runs(trial.foot_loads[:samples, foot, 1] >= LOAD_THRESHOLD_N)
        if first > 0 and last < samples - 1
    ]
    whole.sort(key=lambda contact: contact[1])
    pairs = [
        (contact, other)
        for contact in whole
        for other in whole
        if contact[0] != other[0] and contact[1] < other[1] < contact[2] < other[2]
    ]
    if not pairs:
        raise TrialError("synthetic", "it holds no whole contact of each foot in turn; make it about two strides long")
    return [*min(pairs, key=lambda pair: abs((pair[0][2] + pair[1][1]) - samples))]


def write_lab(folder: str | Path, recordings: LabRecordings, kind: Literal["trc", "c3d"] = "trc") -> Path:
    """Write the files of a laboratory and a subject file that refers to them; return the subject file's path.

    "trc": `static.trc`, `walk.trc`, `walk_grf.mot`. "c3d": `static.c3d`, `walk.c3d`, with Z up and mm.
    """
    from kinertia.io.c3d.writer import write_c3d  # takes a while to load, and studies only need the errors

    files = [("static", recordings.static), ("walk", recordings.walk)]
    with complete_folder(folder, "lab") as work:
        for name, recording in files:
            if kind == "c3d":
                write_c3d(work / f"{name}.c3d", recording)
            else:
                write_trc(work / f"{name}.trc", recording.markers)
        if kind == "trc" and recordings.walk.plates is not None:
            write_sto(work / "walk_grf.mot", force_table(recordings.walk.plates), False, "walk_grf")
        (work / "subject.toml").write_text(_subject_text(kind), encoding="utf-8")
    return Path(folder) / "subject.toml"


def force_table(plates: PlateLoads) -> pd.DataFrame:
    """Return columns named as in OpenSim's examples: force, its point of application on the ground, torque there."""
    columns: dict[str, np.ndarray] = {}
    point = centre_of_pressure(plates.wrench)
    torque = plates.moment - np.cross(point, plates.force)
    for p, name in enumerate(plates.names):
        stems = {f"{name}_v": plates.force, f"{name}_p": point, f"{name.replace('force', 'torque')}_": torque}
        for stem, values in stems.items():
            columns |= {f"{stem}{axis}": values[:, p, k] for k, axis in enumerate("xyz")}
    return pd.DataFrame(columns, index=pd.Index(plates.time, name="time"))


def _subject_text(kind: str) -> str:
    forces = 'forces = "walk_grf.mot"\n' if kind == "trc" else ""
    return (
        "# A synthetic person, measured in a synthetic laboratory.\n"
        f'[subject]\nname = "synthetic walker"\nsex = {json.dumps(SEX)}\nmass_kg = {MASS_KG}\nheight_m = {HEIGHT_M}\n\n'
        f'[model]\nstatic = "static.{kind}"\n\n[[trial]]\nmarkers = "walk.{kind}"\n{forces}'
    )


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
            walking, overall = (
                np.linalg.norm(np.ptp(angles[:, columns] @ directions, axis=0)) for angles in (q, every)
            )
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
            cluster = [m for m in skeleton.markers if m.segment == segment and m.label in markers.labels]
            columns = [markers.labels.index(marker.label) for marker in cluster]
            places = np.array([marker.position for marker in cluster])
            path = np.cos(phase) @ cosines + np.sin(phase) @ sines
            local = path[:, None, :3] + np.cross(path[:, None, 3:], places - places.mean(axis=0))
            turn = pose.rotation[:, None, skeleton.segments.index(segment)]
            positions[:, columns] += (turn @ local[..., None])[..., 0]
        return replace(markers, positions=positions)
