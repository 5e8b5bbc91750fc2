"""Runs the demo: a synthetic person is measured, estimated and compared with the truth.

The truth differs from the literature as much as people do, and the laboratory's instruments have errors. Only the
comparison at the end uses either; the estimator reads the laboratory's files.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from kinertia.estimation.prepared import Progress
from kinertia.estimation.result import Fit
from kinertia.io.results.output_folder import complete_folder
from kinertia.io.subject.person_recordings import read_inputs
from kinertia.io.subject.provenance import command_line, provenance_of
from kinertia.io.subject.reader import read_subject, with_settings
from kinertia.io.subject.tables import SubjectFile
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import inverse_dynamics
from kinertia.report.files import save_fit
from kinertia.report.truth_comparison import Truth
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.walk import SyntheticTrial, unlike_literature, walk, walking_subject
from kinertia.workflow.estimate import estimate_bsp

PLATE_RATE_HZ, SAMPLES_PER_FRAME = 1000.0, 10
"""Force plates at 1000 Hz, cameras at 100 Hz."""
DURATION_S, START = 2.7, 0.75
"""A bit over two strides, begun so that one right and one left contact are whole."""
LABORATORY = LabNoise(delay_s=0.008, gain=0.05)
"""The demo's laboratory: forces are late, and one plate reads too much."""


@dataclass(frozen=True, eq=False)
class Demo:
    """A fit of synthetic files, and the truth behind them.

    Attributes:
        fit: the estimate.
        walk: the person's motion and BSPs, from which the files were made.
        noise: the laboratory's errors.
        subject_file: subject file of the synthetic laboratory.
    """

    fit: Fit
    walk: SyntheticTrial
    noise: LabNoise
    subject_file: Path

    @property
    def truth(self) -> BodySegmentParameters:
        """True BSPs of the person."""
        return self.walk.bsp

    @cached_property
    def moment_errors(self) -> dict[str, tuple[float, float]]:
        """RMS error (N m) of joint moments per joint, by IK + ID and by the estimate."""
        return truth_of(self.walk, self.fit).moment_errors(self.fit)

    @property
    def moment_intervals(self) -> dict[str, tuple[float, float]]:
        """Half-width (N m) of the 95 % intervals of joint moments, and the share that holds the truth, per joint."""
        return truth_of(self.walk, self.fit).moment_intervals(self.fit)

    @cached_property
    def table(self) -> pd.DataFrame:
        """Table with columns segment, parameter, unit, truth, literature, estimate, and sd unless after two-level."""
        table = self.fit.bsp.filter(["segment", "parameter", "unit", "literature", "estimate", "sd"])
        table.insert(3, "truth", self.truth.to_frame()["value"])
        return table

    def rms_errors(self, source: BodySegmentParameters) -> tuple[float, float, float]:
        """Return the RMS errors over the segments of mass (kg), CoM distance (m), moments of inertia (kg m2)."""
        return Truth(self.walk.bsp, {}).parameter_errors(source)


def truth_of(made: SyntheticTrial, fit: Fit) -> Truth:
    """Return the truth behind a fit of one trial."""
    (trial,) = fit.trials
    at = np.searchsorted(made.time, trial.time - 1e-9)
    loads = inverse_dynamics(made.skeleton, made.bsp, made.motion.cut(at), made.foot_loads[at])
    columns = [made.skeleton.coordinates.index(name) for name in fit.skeleton.coordinates]
    return Truth(made.bsp, {trial.name: loads[:, columns]})


def write_synthetic_lab(
    folder: Path, seed: int = 1, noise: LabNoise | None = None
) -> tuple[SubjectFile, SyntheticTrial]:
    """Write the files of a synthetic laboratory, with a subject file; return the latter as read, and the walk."""
    truth_rng, noise_rng = np.random.default_rng(seed).spawn(2)
    subject = unlike_literature(walking_subject(), truth_rng)
    trial = walk(subject, DURATION_S, PLATE_RATE_HZ, START)
    recordings = record(subject, trial, noise or LabNoise(), noise_rng, SAMPLES_PER_FRAME)
    return read_subject(write_lab(folder, recordings)), trial


def run_demo(
    folder: str | Path,
    seed: int = 1,
    noise: LabNoise = LABORATORY,
    progress: Progress = lambda stage, share: None,
    method: Literal["simultaneous", "two-level"] = "simultaneous",
) -> Demo:
    """Make the laboratory's files in `folder`/lab, estimate from them, write results and `bsp_truth.csv` into `folder`.

    Args:
        folder: folder to write to, made if necessary.
        seed: seed of truth and noise.
        noise: the laboratory's errors.
        method: the estimator.
        progress: called as the work progresses.

    Raises:
        FileError: the folder cannot be written to.
    """
    folder = Path(folder)
    with complete_folder(folder, "demo") as work:
        progress("measuring", 0.0)
        wanted, trial = write_synthetic_lab(work / "lab", seed, noise)
        static, inputs, marker_set = read_inputs(wanted, progress)
        of_method = [] if method == "simultaneous" else ["--method", method]
        provenance = provenance_of(wanted, command_line(["kinertia", "demo", *of_method, "-o", str(folder)]))
        settings = with_settings(wanted, method=method).settings
        fit = estimate_bsp(wanted.subject, static, inputs, settings, marker_set, progress)
        save_fit(fit, work, provenance, truth_of(trial, fit), force=True)
        demo = Demo(fit, trial, noise, folder / "lab" / "subject.toml")
        demo.table.to_csv(work / "bsp_truth.csv", index=False, lineterminator="\n")
    return demo
