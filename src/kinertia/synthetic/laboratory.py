"""Measures a synthetic trial as a laboratory would: cameras, skin, two force plates, and files.

The plates measure one right and one left contact; the steps before and after are not measured, as in a real laboratory.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from kinertia.errors import TrialError
from kinertia.io.c3d.writer import write_c3d
from kinertia.io.results.output_folder import complete_folder
from kinertia.io.text.sto import write_sto
from kinertia.io.text.trc import write_trc
from kinertia.synthetic.noise import SkinMotion, camera_noise, plate_noise, study_noise
from kinertia.synthetic.walk import HEIGHT_M, MASS_KG, SEX, SyntheticSubject, SyntheticTrial
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, Markers, PlateLoads, Recording
from kinertia.trial.sampled_time import runs

PLATE_SIZE_M = (0.6, 0.4)
"""Length along the walk and width of a force plate."""


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
        (one, other) for one in whole for other in whole if one[0] != other[0] and one[1] < other[1] < one[2] < other[2]
    ]
    if not pairs:
        raise TrialError("synthetic", "it holds no whole contact of each foot in turn; make it about two strides long")
    return [*min(pairs, key=lambda pair: abs((pair[0][2] + pair[1][1]) - samples))]


def write_lab(folder: str | Path, recordings: LabRecordings, kind: Literal["trc", "c3d"] = "trc") -> Path:
    """Write the files of a laboratory and a subject file that refers to them; return the subject file's path.

    "trc": `static.trc`, `walk.trc`, `walk_grf.mot`. "c3d": `static.c3d`, `walk.c3d`, with Z up and mm.
    """
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
