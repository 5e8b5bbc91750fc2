"""Contexts of results that tests make up, with just what a question looks at."""

from types import SimpleNamespace

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.registry import ESTIMATE_CHECKS
from kinertia.diagnostics.runner import asked, explained
from kinertia.estimation.prepared import TotalMass
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.instruments.instrument_errors import DELAY, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.priors import (
    GAIT27_UNCERTAINTY,
    InstrumentInformation,
    InstrumentPrior,
)
from kinertia.findings.finding import Severity
from kinertia.settings import Settings
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import Markers


def error(quantity, value, prior_sd, sd, unit, plate="plate 1", moved=np.inf, **more):
    """An error of an instrument that matters."""
    kind = "synchronisation" if quantity == DELAY else "plate"
    numbers = {"value": value, "prior_sd": prior_sd, "sd": sd, "unit": unit, "moved": moved}
    return CalibrationEntry(kind=kind, quantity=quantity, plate=plate, **numbers, **more)


def entry_of(fit, quantity, **where):
    """The one entry of an estimate's calibration of this quantity and place."""
    wanted = {"quantity": quantity, "trial": None, "axis": None, **where}
    (found,) = [
        entry for entry in fit.posterior.calibration if all(getattr(entry, name) == at for name, at in wanted.items())
    ]
    return found


def walking(turned_deg=0.0, vertical="+Y"):
    """Kinematics of somebody who walks along +X, after the trial was turned by so much."""
    time = np.linspace(0.0, 2.0, 50)
    positions = np.zeros((50, 2, 3))
    positions[..., 0] = 1.2 * time[:, None]
    trial = SimpleNamespace(vertical=vertical, markers=Markers(time, ("A", "B"), positions))
    return SimpleNamespace(trial=trial, turned_deg=turned_deg)


def context(*errors, ready=(), shown=None, prior=None, mass_kg=None, trials=None, **posterior):
    """Of a fit that found these errors of instruments.

    Args:
        errors: `CalibrationEntry`s.
        ready: of the prepared person.
        shown: what the trials say of instruments; well known if left out.
        prior: of the instruments.
        mass_kg: by the forces of "walk".
        trials: name -> kinematics; one walk if left out.
        posterior: anything else of it.
    """
    known = {"free_moment_sign": None, "marker_noise": (), "marker_distances_m": (), **posterior}
    found = SimpleNamespace(instrument_errors=errors, instruments=shown or well_known(), **known)
    trials = [SimpleNamespace(name=name, kinematics=k) for name, k in (trials or {"walk": walking()}).items()]
    prepared = {
        "total_mass": TotalMass.of(74.6, ()),
        "uncertainty": SimpleNamespace(instruments=prior or InstrumentPrior()),
        **dict(ready),
    }
    skeleton = walking_subject().skeleton
    fit = SimpleNamespace(posterior=found, trials=tuple(trials), skeleton=skeleton)
    made = ResultContext(fit, SimpleNamespace(**prepared))
    made.__dict__["force_masses"] = {"walk": SimpleNamespace(mass_kg=mass_kg)} if mass_kg else {}
    return made


class PartOfFit(SimpleNamespace):
    """What checks read of a `Fit`."""

    departures = property(Fit.departures.func)
    expected_source = Fit.expected_source


def well_known(plates=("left",)):
    """Trials that show everything of these plates."""
    size = 5 * len(plates) + 4
    return InstrumentInformation(tuple(plates), 1e8 * np.eye(size), np.zeros(size))


def codes(findings):
    """Codes of findings, in their order."""
    return [finding.code for finding in findings]


def of_estimate(fitted, *names, literature=None):
    """Findings about an estimate of walks (names) that no other finding explains, but for information.

    Args:
        fitted: `SimultaneousFit`.
        names: of its trials; "walk" if left out.
        literature: that it started from; the synthetic walker's if left out.
    """
    literature = literature or walking_subject().literature
    body = {"estimate": fitted.bsp, "literature": literature, "expected": literature, "more_known": False, "file": None}
    trials = [SimpleNamespace(name=name, kinematics=walking()) for name in names or ("walk",)]
    fit = PartOfFit(
        posterior=fitted.posterior,
        trials=trials,
        converged=fitted.result.converged,
        settings=Settings(cutoff_hz=6.0),
        skeleton=walking_subject().skeleton,
        **body,
    )
    ready = SimpleNamespace(
        total_mass=TotalMass.of(literature.total_mass_kg, ()),
        uncertainty=GAIT27_UNCERTAINTY,
        attached=(),
        elbow_rotations_rad={},
        torso_rotation_rad=None,
    )
    made = ResultContext(fit, ready)
    made.__dict__["force_masses"] = {}
    return [
        finding
        for finding in explained(asked(ESTIMATE_CHECKS, made))
        if finding.is_open and finding.severity > Severity.INFO
    ]
