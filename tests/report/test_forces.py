"""The report says at which bandwidth residuals are, and which forces the joint moments are from."""

from dataclasses import replace

import numpy as np

from kinertia.report.figures.time_figures import bandwidths
from kinertia.report.pages.page import render
from report_page import Elements


def test_residuals_are_told_at_both_bandwidths(fit, two_level):
    for result in (fit, two_level):
        trial = result.trials[0]
        shown = Elements(render(result)).text
        assert f"motion's bandwidth ({bandwidths(trial)})" in shown
        for residuals in (trial.residuals, trial.full_residuals):
            for part in np.hsplit(residuals["estimate"], 2):
                size = np.linalg.norm(part, axis=1)
                assert f"{np.sqrt(np.mean(size**2)):.1f} ({size.max():.1f})" in shown
        assert "what OpenSim's Inverse Dynamics finds on the delivered files" in shown


def test_report_says_which_forces_the_moments_are_from(fit, two_level):
    trial = fit.trials[0]
    (used,) = [finding for finding in fit.findings if finding.code == "R402"]
    assert used.where.trial == trial.name
    assert used.evidence["which"].value in Elements(render(fit)).text
    struck = np.zeros_like(trial.reactions.impact)
    struck[:, 0, 1] = 20.0
    hit = replace(fit, trials=(replace(trial, reactions=replace(trial.reactions, impact=struck)),))
    shown = Elements(render(hit)).text
    assert "less impacts of 20.0 N (RMS over the trial)" in shown
    assert "Bisseling and Hof 2006" in shown
    assert 'force_cutoff_hz = "none" under [settings]' in shown
    assert f"low-passed at {two_level.trials[0].motion_hz:.3g} Hz, the bandwidth" in Elements(render(two_level)).text
