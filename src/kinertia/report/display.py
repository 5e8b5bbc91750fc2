"""Shows and saves trials and fits: what their methods ask for through `kinertia.findings.extensions`."""

from pathlib import Path
from typing import Any

from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.gait_scores import GaitProfile
from kinertia.estimation.result.mean_cycles import gait_profile
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.findings.finding import Severity
from kinertia.io.norms_file import read_norms
from kinertia.report.exports.contents import content_of
from kinertia.report.exports.datasets import curve_dataset as curve_dataset
from kinertia.report.exports.datasets import draw_dataset as draw_dataset
from kinertia.report.exports.files import save_fit
from kinertia.report.figures.plots import FitFigures, as_plotly
from kinertia.report.figures.plots import save_figure as save_figure
from kinertia.report.pages.finding_view import lines
from kinertia.report.pages.page import bsp_rows, residual_rows
from kinertia.report.pages.rendering import rendered
from kinertia.report.wording import start_of
from kinertia.trial.data import LOAD_THRESHOLD_N, Markers, Recording, Trial
from kinertia.trial.sampled_data import rms


def fit_html(fit: Fit) -> str:
    """Show verdict, findings, residuals and body segment parameters."""
    return rendered(
        "notebook_fit.html.j2",
        fit=fit,
        found=lines(fit.findings),
        residuals=residual_rows(fit.trials),
        start=start_of(fit).word,
        rows=bsp_rows(fit),
        information=fit.posterior is not None,
    )


def saved(fit: Fit, folder: str | Path, force: bool = False) -> Path:
    """Compute and write all result files of a fit."""
    return save_fit(content_of(fit), folder, force)


def trial_html(trial: Trial) -> str:
    """Show frames, markers and their gaps, measured windows, peak vertical force under each foot, and findings."""
    peaks = trial.loads.force[:, :, 1].max(axis=0, initial=0.0)
    return rendered(
        "notebook_trial.html.j2",
        trial=trial,
        found=lines(trial.findings, Severity.INFO),
        gappy=_gappy(trial.markers),
        peaks=[float(peak) if peak > LOAD_THRESHOLD_N else None for peak in peaks],
    )


def trial_fit_html(trial: TrialFit) -> str:
    """Show window, distances of the markers, residuals before and after, and computing time."""
    return rendered(
        "notebook_trial_fit.html.j2",
        trial=trial,
        errors_mm={stage: 1e3 * rms(errors) for stage, errors in trial.marker_errors_m.items()},
        residuals=residual_rows([trial]),
        start="before",  # a trial does not know whether that was the literature or a model
    )


def recording_html(recording: Recording) -> str:
    """Show frames, markers and gaps, plates and the largest force on each, known data of the person, and findings."""
    plates = recording.plates
    peaks = [] if plates is None else plates.force[:, :, 1].max(axis=0, initial=0.0)
    return rendered(
        "notebook_recording.html.j2",
        recording=recording,
        found=lines(recording.findings, Severity.INFO),
        gappy=_gappy(recording.markers),
        peaks=[] if plates is None else [(name, float(peak)) for name, peak in zip(plates.names, peaks, strict=True)],
    )


def _gappy(markers: Markers) -> list[tuple[str, float]]:
    """Return labels of markers that are not always visible, with the percentage of frames with them, lowest first."""
    seen = markers.seen.mean(axis=0)
    shares = [(label, 100 * float(share)) for label, share in zip(markers.labels, seen, strict=True) if share < 1]
    return sorted(shares, key=lambda item: item[1])


def pictures(fit: Fit) -> FitFigures[Any]:
    """Return the figures of a fit, one method for each, for plotly."""
    return FitFigures(fit, as_plotly)


def scored(fit: Fit, norms: str | Path) -> GaitProfile:
    """Compute gait scores of a fit against the norms in a file."""
    return gait_profile(fit, read_norms(norms))
