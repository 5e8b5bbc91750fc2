"""Compare peak joint moments with Vicon's own."""

import contextlib
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kinertia.cli.app import main as kinertia
from kinertia.estimation.result import Fit
from kinertia.report.file_outputs import OutputComparison, compared_outputs
from kinertia.report.saved_fit import load_fit
from kinertia.report.wording import INTERVAL_SD
from validation.measured_data import data_folder
from validation.measured_trials import table
from validation.page import write_page
from validation.walks import fit_arguments

WALKS = {"Plug-in Gait A": "pig_a", "Plug-in Gait B": "pig_b"}
FOLDERS = {
    "Clinic FMC": "field/fmc",
    "Clinic Sydney": "field/sydney",
    "Clinic MH": "field/mh",
    "Clinic RBWH": "field/rbwh",
    "CGM2.4, no static trial": "field/cgm24",
}
_CLEAR_SD = 2.0
_PERCENT, _MS = 100.0, 1000.0
_FEWEST = 20
"""Frames that both have."""
_BESIDE = 3
"""Frames on both sides of a peak that are needed: at the end of a window there is none."""
_LEAST_NM_KG = 0.1
"""Smaller peaks are of legs that are not on a plate."""


def commands(data: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield the title and arguments of every fit."""
    for title, walk in WALKS.items():
        yield title, fit_arguments(data, walk)
    for title, folder in FOLDERS.items():
        yield title, [str(data / folder)]


def fitted(arguments: list[str], out: Path) -> Fit:
    """Fit as a user would, and read the result."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        kinertia(["fit", *arguments, "-o", str(out), "--quiet"])
    return load_fit(out)


def corrections(fit: Fit) -> str:
    """List the clear gains and delays that the fit has corrected, which Vicon has not."""
    found = []
    for one in () if fit.posterior is None else fit.posterior.calibration:
        if one.sd and abs(one.value) > _CLEAR_SD * one.sd:
            if one.quantity == "gain":
                found.append(f"{one.plate} {_PERCENT * one.value:+.1f} %")
            elif one.quantity == "delay":
                found.append(f"delay {_MS * one.value:.1f} ms")
    return ", ".join(dict.fromkeys(found)) or "-"


def rows(title: str, fit: Fit) -> Iterator[tuple[list[str], float]]:
    """Yield the rows of a person, each with the difference of the peaks, N m/kg."""
    for trial in fit.trials:
        for one in compared_outputs(fit, trial):
            both = np.isfinite(one.theirs) & np.isfinite(one.ours)
            if one.kind == "MOMENTS" and both.sum() >= _FEWEST and _has_peak(one.theirs, both):
                yield _row(title, fit, one, both)


def _has_peak(theirs: np.ndarray, both: np.ndarray) -> bool:
    """Decide whether a curve reaches its largest value within the frames, not at an end of them."""
    at = int(np.argmax(np.where(both, theirs, -np.inf)))
    around = both[max(at - _BESIDE, 0) : at + _BESIDE + 1]
    return bool(theirs[at] >= _LEAST_NM_KG and len(around) == 2 * _BESIDE + 1 and around.all())


def _row(title: str, fit: Fit, one: OutputComparison, both: np.ndarray) -> tuple[list[str], float]:
    ours, theirs = one.ours[both], one.theirs[both]
    bar = INTERVAL_SD * one.sd[both][int(np.argmax(ours))]
    off = float(ours.max() - theirs.max())
    numbers = [f"{theirs.max():.2f}", f"{ours.max():.2f} ± {bar:.2f}", f"{off:+.2f}"]
    leg = {"r": "right", "l": "left"}[one.side]
    return [title, one.trial, f"{leg} {one.joint.lower()}", *numbers, corrections(fit)], off


def document(compared: list[tuple[list[str], float]]) -> str:
    """Return the text of docs/validation/vicon-moments.md."""
    heads = ["recording", "trial", "joint", "Vicon", "Kinertia, 95 %", "difference", "corrected"]
    means = []
    for joint in ("ankle", "knee", "hip"):
        off = np.array([off for row, off in compared if row[2].endswith(joint)])
        within = f"{(np.abs(off) <= 0.1).sum()} of {len(off)}"
        means.append([joint, within, f"{off.mean():+.2f}", f"{np.sqrt(np.square(off).mean()):.2f}"])
    summary = table(["joint", "within 0.1 N m/kg", "mean", "RMS"], means)
    return TEXT.format(summary=summary, results=table(heads, [row for row, _ in compared]))


TEXT = """# Moments of Vicon

Peak extension moments (ankle: plantarflexion), N m/kg, within the frames of the fit: Plug-in Gait's in the files, and
Kinertia's in the same axes. Differences are Kinertia's minus Vicon's.

{summary}

Why they differ: Plug-in Gait's ankle moments equal those of the recorded forces about its ankle centre within
0.02 N m/kg (FMC, Sydney, CGM2.4). Kinertia's ankle centres are within 4 mm of these along the foot (FMC; CGM2.4: 6 mm),
but it corrects gains and delays of plates, which Vicon takes as they are (*corrected*, by more than two standard
deviations). A gain of -3.7 % adds 0.05 N m/kg at the ankle, and a delay of 11 ms about as much. Hip moments depend on
segment masses, hip centres and smoothing besides.

{results}
"""


def main() -> None:
    """Run all fits and write the page."""
    data, compared = data_folder(), []
    with tempfile.TemporaryDirectory() as folder:
        for k, (title, arguments) in enumerate(commands(data)):
            found = list(rows(title, fitted(arguments, Path(folder) / str(k))))
            compared += found
            print(f"{title}: {len(found)} peaks", flush=True)
    write_page("vicon-moments", document(compared))
