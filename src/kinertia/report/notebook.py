"""How a `Fit` and a `Trial` show themselves in a notebook."""

from __future__ import annotations

import numpy as np

from kinertia.fit import Fit
from kinertia.report.page import bsp_rows, rendered, residual_rows
from kinertia.report.verdict import words
from kinertia.trial import LOAD_THRESHOLD_N, Trial


def fit_html(fit: Fit) -> str:
    """Verdict, warnings, residuals and body segment parameters."""
    return rendered(
        "notebook_fit.html.j2",
        fit=fit,
        words=words(fit),
        residuals=residual_rows(fit),
        rows=bsp_rows(fit),
        information=fit.posterior is not None,
    )


def trial_html(trial: Trial) -> str:
    """Frames, markers and their gaps, measured windows, peak vertical force under each foot, notes."""
    seen = np.asarray(np.isfinite(trial.markers.positions).all(axis=2)).mean(axis=0)
    gappy = [(label, 100 * float(share)) for label, share in zip(trial.markers.labels, seen, strict=True) if share < 1]
    peaks = trial.loads.force[:, :, 1].max(axis=0, initial=0.0)
    return rendered(
        "notebook_trial.html.j2",
        trial=trial,
        gappy=sorted(gappy, key=lambda item: item[1]),
        peaks=[float(peak) if peak > LOAD_THRESHOLD_N else None for peak in peaks],
    )
