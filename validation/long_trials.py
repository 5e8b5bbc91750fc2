"""Measure memory and seconds of walks of minutes.

Memory and seconds of walks of minutes, from markers to error bars.

Every length runs in a process of its own, which has nothing else in its memory. One stride on a treadmill, made exactly
as the other synthetic walks, is repeated; skin motion comes back with every stride, the cameras' noise does not.
"""

import json
import re
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from kinertia.estimation.prior import BspPrior, literature_prior
from kinertia.estimation.simultaneous.fit import fit_simultaneous
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import solve_kinematics
from kinertia.synthetic.laboratory import SkinMotion, camera_noise
from kinertia.synthetic.walk import Manner, SyntheticTrial, unlike_literature, walk, walking_subject
from kinertia.trial.data import FootLoads, Markers, Trial
from validation.measured_trials import table
from validation.page import REPOSITORY, write_page
from validation.synthetic_walks import BANDWIDTH, FIRST_SEED

MINUTES = (0.5, 1.0, 3.0, 10.0)
FAST_PLATES_HZ = 1000.0
"""Plates' rate with which the longest walk is run once more."""
RATE_HZ, FRAMES = 100.0, 124
"""Frames to a stride: it takes a whole number of them, at a pace that differs from the recorded one by 1 %."""
_CAMERA_SD_M = 0.0005


@dataclass(frozen=True)
class Long:
    """Time and memory taken by a walk of this many minutes.

    Attributes:
        plates_hz: samples of the force plates per second.
        kinematics_s, estimate_s: seconds of processor time.
        wall_clock_s: wall-clock seconds of both, in two threads where there are two cores.
        before_mb, kinematics_mb, estimate_mb: peak memory until the data are loaded, until inverse kinematics and
            smoothing are done, and until the end.
        iterations: Gauss-Newton steps.
    """

    minutes: float
    frames: int
    plates_hz: float
    kinematics_s: float
    estimate_s: float
    before_mb: float
    kinematics_mb: float
    estimate_mb: float
    iterations: int
    wall_clock_s: float


def stride(plates_hz: float = RATE_HZ) -> tuple[SyntheticTrial, BspPrior, Markers, np.ndarray]:
    """Return a stride on a treadmill: its trial, the literature's prior, its markers with skin motion, and the loads on
    the feet at the plates' rate, all of which repeat a stride later.
    """
    rng = np.random.default_rng(FIRST_SEED)
    person = unlike_literature(walking_subject(), rng)
    manner = Manner(pace=float(walk(person).time[-1] * RATE_HZ / FRAMES))
    trial, on_plates = (
        walk(person, FRAMES / RATE_HZ, rate, trapezoid=False, manner=manner) for rate in (RATE_HZ, plates_hz)
    )
    skin = SkinMotion.draw(trial.skeleton, trial.motion.q, rng)
    markers = skin.moved(trial.markers, trial.skeleton, trial.motion.q)
    loads = on_plates.foot_loads.copy()
    loads[..., 3:] += np.cross(_back(on_plates), loads[..., :3])
    positions = markers.positions + _back(trial)
    return trial, literature_prior(person.literature), replace(markers, positions=positions), loads


def _back(trial: SyntheticTrial) -> np.ndarray:
    """Return (n, 1, 3) m, how far the belt has carried everything back at each frame."""
    x = trial.motion.q[:, 0]
    carried = np.zeros((len(x), 1, 3))
    carried[:, 0, 0] = -(x[-1] - x[0]) * np.arange(len(x)) / (len(x) - 1)
    return carried


def long_walk(minutes: float, plates_hz: float = RATE_HZ) -> tuple[Skeleton, BspPrior, Trial]:
    """Repeat the stride for this many minutes."""
    trial, prior, markers, loads = stride(plates_hz)
    frames, samples = (np.arange(round(60.0 * minutes * rate)) for rate in (RATE_HZ, plates_hz))
    rng = np.random.default_rng(FIRST_SEED)
    seen = Markers(frames / RATE_HZ, markers.labels, markers.positions[frames % FRAMES])
    seen = camera_noise(seen, _CAMERA_SD_M, rng)
    again = loads[samples % (len(loads) - 1)]
    feet = FootLoads(samples / plates_hz, again[..., :3], again[..., 3:])
    return trial.skeleton, prior, Trial("walk", seen, feet, np.ones(len(frames), dtype=bool))


def measured(minutes: float, plates_hz: float) -> Long:
    """Measure a walk in this process."""
    skeleton, prior, trial = long_walk(minutes, plates_hz)
    started = time.perf_counter()
    marks = [(time.process_time(), _most_mb())]
    kinematics = solve_kinematics(skeleton, trial, 0.0, BANDWIDTH.motion_hz)
    marks.append((time.process_time(), _most_mb()))
    fitted = fit_simultaneous(skeleton, prior, [kinematics], [BANDWIDTH])
    marks.append((time.process_time(), _most_mb()))
    (begun, before), (solved, kinematics_mb), (ended, estimate_mb) = marks
    spent = (solved - begun, ended - solved, before, kinematics_mb, estimate_mb)
    wall_clock_s = time.perf_counter() - started
    return Long(minutes, len(trial.markers.time), plates_hz, *spent, fitted.result.iterations, wall_clock_s)


def in_own_process(minutes: float, plates_hz: float = RATE_HZ) -> Long:
    """Measure a walk in a separate process, with nothing else in memory."""
    command = [sys.executable, "-m", __name__, str(minutes), str(plates_hz)]
    done = subprocess.run(command, cwd=REPOSITORY, check=True, stdout=subprocess.PIPE)
    return Long(**json.loads(done.stdout))


def _most_mb() -> float:
    """Return the peak memory (MB) of this process."""
    if sys.platform == "linux":
        # the other figure begins with what the process held that started it
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return float(re.findall(r"VmHWM:\s+(\d+) kB", status)[0]) / 1e3
    import resource  # which Windows lacks

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def document(walks: list[Long]) -> str:
    """Return the text of docs/validation/long-trials.md."""
    rows = [
        [
            f"{w.minutes:g} min",
            str(w.frames),
            f"{w.plates_hz:g}",
            f"{w.before_mb:.0f}",
            f"{w.kinematics_mb:.0f}",
            f"{w.estimate_mb:.0f}",
            f"{w.kinematics_s:.1f}",
            f"{w.estimate_s:.1f}",
            str(w.iterations),
            f"{1e3 * (w.kinematics_s + w.estimate_s) / w.frames:.2f}",
            f"{1e3 * w.wall_clock_s / w.frames:.2f}",
        ]
        for w in walks
    ]
    headings = ["walk", "frames", "plates (Hz)", "data (MB)", "kinematics (MB)", "estimate (MB)"]
    headings += ["kinematics (s)", "estimate (s)", "steps", "processor (ms per frame)", "elapsed (ms per frame)"]
    return f"""# Long trials

A synthetic walk on a treadmill, its markers (41) at 100 Hz, 27 coordinates; seconds of processor time. The last two
columns cover kinematics and estimate: processor time, and elapsed time on a machine with two cores. Memory is the
largest of the process, the program included, until the data are read, until inverse kinematics and smoothing are done,
and until the end.

{table(headings, rows)}

Time is linear. Up to about a minute, counted over all trials of a fit, the normal equations are in memory as a whole.
Longer walks are processed in blocks of a few seconds; intermediate results go to a temporary file, about 1.5 GB
for ten minutes. The results are the same to rounding. Memory grows by what there is of every frame:
markers, coordinates, loads. Of the loads, at the plates' rate, the estimate holds several copies (as measured, without
impacts, corrected, smooth): with fast plates they are most of it.
"""


def main(
    minutes: Annotated[list[float] | None, typer.Option(help="Length; may be given several times.")] = None,
) -> None:
    """Measure and write the page."""
    lengths = minutes or MINUTES
    walks = [*((length, RATE_HZ) for length in lengths), (max(lengths), FAST_PLATES_HZ)]
    write_page("long-trials", document([in_own_process(*arguments) for arguments in walks]))


if __name__ == "__main__":
    print(json.dumps(asdict(measured(*map(float, sys.argv[1:])))))
