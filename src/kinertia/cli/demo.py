"""Defines `kinertia demo`: fits a synthetic person of known truth, or a measured walk that is downloaded.

The truth differs from the literature as much as people do, and the laboratory's instruments have errors. Only the
comparison at the end uses either; the estimator reads the laboratory's files.
"""

import shutil
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer

from kinertia.cli.common import Outcome, Output, Overwrite, Quiet, out, plain_table, results_folder, shown_progress
from kinertia.cli.findings import show_coverage, show_overview
from kinertia.estimation.prepared import Progress
from kinertia.estimation.result.fit import Fit
from kinertia.io.file_names import command_line
from kinertia.io.output_folder import complete_folder
from kinertia.io.samples import SHA256, sample_walk
from kinertia.io.subject.provenance import provenance_of
from kinertia.io.subject.reader import read_subject, with_settings
from kinertia.io.subject.tables import SubjectFile
from kinertia.model.bsp import BodySegmentParameters
from kinertia.motion.dynamics import inverse_dynamics
from kinertia.report.exports.contents import content_of, summary
from kinertia.report.exports.files import save_fit
from kinertia.report.pages.truth_comparison import Truth
from kinertia.settings import MethodName
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.walk import SyntheticTrial, unlike_literature, walk, walking_subject
from kinertia.workflow.from_files import fit_subject

_SHOWN_JOINTS = ("hip flexion", "hip adduction", "knee", "ankle", "lumbar extension")
"""Joints on the terminal; `report.html` has all."""
PLATE_RATE_HZ, SAMPLES_PER_FRAME = 1000.0, 10
"""Force plates at 1000 Hz, cameras at 100 Hz."""
DURATION_S, START = 2.7, 0.75
"""A bit over two strides, begun so that one right and one left contact are whole."""
LABORATORY = LabNoise(delay_s=0.008, gain=0.05)
"""The demo's laboratory: forces are late, and one plate reads too much."""
_SUBJECT = """# OpenSim's gait2354 example: https://github.com/opensim-org/opensim-models, Pipelines/Gait2354_Simbody.

[subject]
name = "gait2354"
sex = "male"
mass_kg = 72.6
height_m = 1.803

[model]
static = "subject01_static.trc"

[[trial]]
markers = "subject01_walk1.trc"
forces = "subject01_walk1_grf.mot"
loads = "subject01_walk1_grf.xml"
"""


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
    method: MethodName = "simultaneous",
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
        of_method = [] if method == "simultaneous" else ["--method", method]
        provenance = provenance_of(wanted, command_line(["kinertia", "demo", *of_method, "-o", str(folder)]))
        fit = fit_subject(with_settings(wanted, method=method), progress)
        save_fit(content_of(fit, provenance, truth_of(trial, fit)), work, force=True)
        demo = Demo(fit, trial, noise, folder / "lab" / "subject.toml")
        demo.table.to_csv(work / "bsp_truth.csv", index=False, lineterminator="\n")
    return demo


def demo(
    measured: Annotated[
        bool, typer.Option("--measured", help="Fit a measured walk instead (downloaded once).")
    ] = False,
    method: Annotated[MethodName, typer.Option(help="Estimator.")] = "simultaneous",
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Show what Kinertia does; needs no files.

    A synthetic person walks through a synthetic laboratory whose instruments have
    errors; Kinertia then estimates from its files and compares the estimate with
    the truth. With --method two-level, it does so by the study's estimator.

    With --measured, Kinertia fits a recorded walk: OpenSim's gait2354 example,
    downloaded once (0.9 MB; first run pip install ".\\[samples]"). Results,
    report and exit status are those of kinertia fit.

    [bold]Examples[/]

    kinertia demo -o out

    kinertia demo --measured -o out
    """
    results_folder(output, overwrite)
    if measured:
        if method != "simultaneous":
            raise typer.BadParameter("is for the synthetic person; leave out --measured", param_hint="'--method'")
        return _measured_demo(output)
    with shown_progress() as progress:
        result = run_demo(output, progress=progress, method=method)
    _report_demo(result, output)
    return Outcome({"folder": str(output), **summary(result.fit), "truth": _against_truth(result)})


def _measured_demo(folder: Path) -> Outcome:
    with shown_progress() as progress:
        fit = run_measured_demo(folder, progress)
    out.print(
        "\nA measured walk, whose truth is unknown: OpenSim's gait2354 example, a man walking over force "
        "plates, from https://github.com/opensim-org/opensim-models (Apache License 2.0)."
    )
    show_overview(fit.overview, verbose=False)
    show_coverage(fit)
    lab = folder / "lab"
    check = command_line(["kinertia", "check", str(lab / "subject.toml")])
    out.print(
        f"results in {folder}, the laboratory's files in {lab}\nto see what the files are like: {check}",
        soft_wrap=True,
    )
    return Outcome({"folder": str(folder), **summary(fit)}, int(fit.overview.failed))


def _against_truth(result: Demo) -> dict[str, Any]:
    """Return RMS errors of the parameters by estimate, and per joint of the moments (N m), with their intervals."""
    names = ("mass_kg", "com_m", "inertia_kgm2")
    bodies = {"literature": result.fit.literature, "estimate": result.fit.estimate}
    intervals = result.moment_intervals
    return {
        "rms_errors": {name: dict(zip(names, result.rms_errors(body), strict=True)) for name, body in bodies.items()},
        "moment_rms_errors_Nm": {
            joint: dict(zip(("usual_pipeline", "estimate"), pair, strict=True))
            for joint, pair in result.moment_errors.items()
        },
        "moment_intervals": {
            joint: dict(zip(("half_width_Nm", "share_with_truth"), pair, strict=True))
            for joint, pair in intervals.items()
        },
    }


def _report_demo(result: Demo, folder: Path) -> None:
    out.print(
        "A synthetic person (72.6 kg, 1.803 m) unlike the body tables, measured with 4-18 mm of skin motion. "
        "Kinertia read the files; only this comparison knows the truth."
    )
    out.print(_moment_table(result))
    out.print(_faults(result))
    show_overview(result.fit.overview, verbose=False)
    before, after = (result.rms_errors(body) for body in (result.fit.literature, result.fit.estimate))
    out.print(
        "\nThe body, RMS error against the truth, tables -> estimate: "
        f"mass {before[0]:.2f} -> {after[0]:.2f} kg, centres of mass {before[1] * 1e3:.0f} -> {after[1] * 1e3:.0f} mm, "
        f"moments of inertia {before[2]:.4f} -> {after[2]:.4f} kg m2"
    )
    if result.fit.posterior is None:
        out.print(_two_level_verdict(before, after))
    out.print(f"\nreport: {folder / 'report.html'}; files: {folder / 'lab'}", soft_wrap=True)
    out.print("your own: kinertia init FOLDER; kinertia fit FOLDER/subject.toml -o out", soft_wrap=True)


def _moment_table(result: Demo) -> Any:
    intervals = result.moment_intervals
    bars = ("95 % interval", "truth inside") if intervals else ()
    table = plain_table("joint moments against the truth", "IK + ID", "Kinertia", *bars)
    for joint in _SHOWN_JOINTS:
        off = [f"{value:.1f} N m" for value in result.moment_errors[joint]]
        if intervals:
            half, inside = intervals[joint]
            off += [f"+- {half:.1f} N m", f"{100 * inside:.0f} %"]
        table.add_row(joint, *off)
    return table


def _faults(result: Demo) -> str:
    """Return what the laboratory did wrong, by the numbers of this run."""
    noise = result.noise
    faults = [
        f"plate 2 read {100 * noise.gain:.0f} % too much" if noise.gain else "",
        f"forces lagged by {1e3 * noise.delay_s:.0f} ms" if noise.delay_s else "",
    ]
    known = " and ".join(filter(None, faults)) or "nothing but noise"
    if result.fit.posterior is None:
        return f"The laboratory's errors: {known}. Two-level corrects no instruments."
    return f"The laboratory's errors: {known}. Kinertia reports:"


def _two_level_verdict(before: tuple[float, float, float], after: tuple[float, float, float]) -> str:
    """Compare two-level's RMS errors with the tables' in a sentence, by the numbers of this run."""
    worse = sum(by_tables < by_fit for by_tables, by_fit in zip(before, after, strict=True))
    if worse == len(before):
        finding = "Two-level explains the forces far better, yet every class of parameters is further from the truth"
    elif worse:
        finding = f"Two-level explains the forces far better, yet {worse} of 3 classes of parameters are further off"
    else:
        return (
            "Two-level is nearer to the truth than the literature in this run. With skin motion that is luck "
            "rather than the rule: see docs/validation/study.md."
        )
    return (
        f"{finding} than the literature: with skin motion, small residuals do not prove the parameters right. "
        "The study that two-level comes from found the same (docs/validation/study.md); without noise two-level "
        "finds them exactly (kinertia study table1)."
    )


def write_measured_lab(folder: Path, progress: Progress = lambda stage, share: None) -> Path:
    """Copy the sample walk into a folder, made if necessary, with a subject file, and return that file.

    Raises:
        KinertiaError: it is not on this computer and cannot be downloaded.
    """
    source = sample_walk(progress)
    folder.mkdir(parents=True, exist_ok=True)
    for name in SHA256:
        shutil.copyfile(source / name, folder / name)
    subject = folder / "subject.toml"
    subject.write_text(_SUBJECT, encoding="utf-8")
    return subject


def run_measured_demo(folder: str | Path, progress: Progress = lambda stage, share: None) -> Fit:
    """Copy the sample walk to `folder`/lab, fit it, and write the results of the fit into `folder`.

    Args:
        folder: folder to write to, made if necessary.
        progress: called as the work progresses.

    Raises:
        FileError: the folder cannot be written to.
        KinertiaError: the walk is not on this computer and cannot be downloaded.
    """
    folder = Path(folder)
    with complete_folder(folder, "demo") as work:
        wanted = read_subject(write_measured_lab(work / "lab", progress))
        fit = fit_subject(wanted, progress)
        command = command_line(["kinertia", "demo", "--measured", "-o", str(folder)])
        save_fit(content_of(fit, provenance_of(wanted, command)), work, force=True)
    return fit
