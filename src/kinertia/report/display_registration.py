"""Registers with `kinertia.trial.display` how trials and fits are shown and saved; loaded at the first use."""

from kinertia.estimation.gait_profile import gait_profile
from kinertia.estimation.result import Fit
from kinertia.estimation.trial_fit import TrialFit
from kinertia.io.norms_file import read_norms
from kinertia.report.datasets import curve_dataset, draw_dataset
from kinertia.report.files import save_fit
from kinertia.report.journal_figure import save_figure
from kinertia.report.notebook import fit_html, recording_html, trial_fit_html, trial_html
from kinertia.report.plots import FitFigures, as_plotly
from kinertia.trial import display
from kinertia.trial.data import Recording, Trial

display.html.register(Recording, recording_html)
display.html.register(Trial, trial_html)
display.html.register(TrialFit, trial_fit_html)
display.html.register(Fit, fit_html)
display.pictures.register(Fit, lambda fit: FitFigures(fit, as_plotly))
display.save.register(Fit, save_fit)
display.figure.register(Fit, save_figure)
display.dataset.register(Fit, curve_dataset)
display.draws.register(Fit, draw_dataset)
display.gait_profile.register(Fit, lambda fit, norms: gait_profile(fit, read_norms(norms)))
