"""Defines `kinertia demo --measured`: downloads OpenSim's gait2354 example once and fits it."""

import shutil
from pathlib import Path

from kinertia.estimation.prepared import Progress
from kinertia.estimation.result import Fit
from kinertia.io.results.output_folder import complete_folder
from kinertia.io.samples import SHA256, sample_walk
from kinertia.io.subject.provenance import command_line, provenance_of
from kinertia.io.subject.reader import read_subject
from kinertia.report.files import save_fit
from kinertia.workflow.from_files import fit_subject

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
        save_fit(fit, work, provenance_of(wanted, command), force=True)
    return fit
