"""Count the frames in which a leg's moments are known."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.motion.joint_moments import joint_and_side
from kinertia.report.exports.saved_fit import FIT_FILE, load_fit
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N
from kinertia.trial.sampled_data import nearest_samples
from kinertia.trial.trial_input import GAIT
from validation.field_trials import cases, run
from validation.measured_data import data_folder
from validation.measured_trials import table


@dataclass(frozen=True)
class Counted:
    """Frames of one leg of a trial between the first and the last contact of its foot with a plate.

    Attributes:
        side: "r" or "l".
        possible: the foot is wholly on plates or in the air, and markers show the leg.
        known: of these, all moments of the leg are known.
        inner: of the possible frames, those at least half a period of the cutoff away from the ends of the motion.
        complete: of the possible frames, those in which all contact of both feet was measured.
    """

    side: str
    possible: int
    known: int
    inner: int
    complete: int


def counted(trial: TrialFit) -> Iterator[Counted]:
    """Count the frames of each leg that meets a plate."""
    k, skeleton = trial.kinematics, trial.skeleton
    recorded, time = k.trial, k.trial.markers.time
    loaded = recorded.loads.force[nearest_samples(recorded.loads.time, time), :, 1] >= LOAD_THRESHOLD_N
    (first, last), ends_s = k.spline.time[[0, -1]], 0.5 / k.cutoff_hz
    inner, inside = (time >= first + ends_s) & (time <= last - ends_s), k.inside(time) & k.complete
    for foot, (side, segment) in enumerate(zip(FEET, skeleton.feet, strict=True)):
        frames = np.flatnonzero(loaded[:, foot])
        if len(frames):
            columns = np.unique(skeleton.map.owner[skeleton.support[skeleton.segments.index(segment)]])
            possible = recorded.known_legs[:, foot] & np.isfinite(k.ik.q[:, columns]).all(axis=1)
            possible[: frames[0]] = possible[frames[-1] + 1 :] = False
            known = np.zeros(len(time), dtype=bool)
            known[k.trajectory_frames] = _known(trial, side)
            masks = (known, inner, inside)
            yield Counted(side, int(possible.sum()), *(int((possible & mask).sum()) for mask in masks))


def _known(trial: TrialFit, side: str) -> np.ndarray:
    """Return the mask (f,) of `trajectory_frames` in which all moments of a leg are known."""
    assert trial.joint_curves is not None
    joints = trial.joint_curves.joints["estimate"]
    columns = [n for n, name in enumerate(joints.joints) if joint_and_side(name)[1] == side]
    result: np.ndarray = np.isfinite(joints.moments[:, columns]).all(axis=(1, 2))
    return result


def main() -> None:
    """Fit all recordings of strides of field_cases.toml, and print the table."""
    rows, total = [], np.zeros(4, dtype=int)
    with tempfile.TemporaryDirectory() as folder:
        for number, case in enumerate(cases(data_folder())):
            out = Path(folder) / str(number)
            if case.arguments[0] != "fit" or run(case, out).status == 2 or not (out / FIT_FILE).is_file():
                continue
            for trial in load_fit(out).trials:
                for count in counted(trial) if trial.kinematics.trial.task in GAIT else ():
                    counts = [count.possible, count.known, count.inner, count.complete]
                    total += counts
                    share = f"{100 * count.known / max(count.possible, 1):.1f}"
                    rows.append([f"{case.title}, {trial.name}", count.side, *map(str, counts), share])
    rows.append(["all", "", *map(str, total), f"{100 * total[1] / total[0]:.1f}"])
    heads = ["walk", "leg", "possible frames", "known", "away from the ends", "all contact measured", "known (%)"]
    print(table(heads, rows))
