"""`kinertia demo --measured`: a measured walk that the package brings along, fitted as `kinertia fit` does."""

from __future__ import annotations

import shutil
from pathlib import Path

from kinertia.estimation.from_files import fit_subject
from kinertia.estimation.prepare import Progress
from kinertia.estimation.result import Fit
from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import command_line, provenance_of
from kinertia.io.subject_file import read_subject
from kinertia.report.files import save_fit

FILES = Path(__file__).with_name("measured_walk")
"""The walk with its subject file and licence; README.txt tells where it comes from."""


def run_measured_demo(folder: str | Path, progress: Progress = lambda stage, share: None) -> Fit:
    """Copy the measured walk to `folder`/lab, fit it, and write the results of the fit into `folder`.

    Args:
        folder: is made if need be.
        progress: called as the work goes on.

    Raises:
        FileError: the folder cannot be written to.
    """
    folder = Path(folder)
    with complete_folder(folder, "demo") as work:
        shutil.copytree(FILES, work / "lab", copy_function=shutil.copyfile)
        wanted = read_subject(work / "lab" / "subject.toml")
        fit = fit_subject(wanted, progress)
        command = command_line(["kinertia", "demo", "--measured", "-o", str(folder)])
        save_fit(fit, work, provenance_of(wanted, command), force=True)
    return fit
