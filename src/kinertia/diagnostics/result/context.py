"""Holds the subject of the checks of a result: the fit, and the person that it was made from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from kinertia.diagnostics.evidence.force_mass import ForceMass, force_mass
from kinertia.diagnostics.evidence.landmarks import owners_of
from kinertia.diagnostics.marker_context import Axes
from kinertia.estimation.prepared import Prepared
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.instruments.instrument_errors import CalibrationEntry
from kinertia.findings.quantity import Where
from kinertia.motion.kinematics import Kinematics
from kinertia.trial.marker_quality import travel

_GROUND_AXES = {"x": 0, "z": 2}


@dataclass(frozen=True, eq=False)
class ResultContext:
    """A fit, and the person and recordings that it was made from.

    Attributes:
        fit: the fit as estimated.
        ready: the person as prepared, before any estimate.
    """

    fit: Fit
    ready: Prepared

    @property
    def errors(self) -> Sequence[CalibrationEntry]:
        """Calibration entries of plates and synchronisation that the fit found; none after two-level."""
        return () if self.fit.posterior is None else self.fit.posterior.instrument_errors

    @cached_property
    def force_masses(self) -> Mapping[str, ForceMass]:
        """Body mass by trial from its vertical force and its markers, for trials that show it."""
        owners = owners_of(self.ready.skeleton)
        masses = {trial.name: force_mass(owners, trial.kinematics.trial) for trial in self.fit.trials}
        return {name: mass for name, mass in masses.items() if mass is not None}

    @cached_property
    def _axes(self) -> Mapping[str, Axes]:
        return {trial.name: lab_axes(trial.kinematics) for trial in self.fit.trials}

    def at(self, error: CalibrationEntry) -> Where:
        """Return the plate, trial and axis of an instrument error."""
        return self.along(error.axis, error.trial, error.plate)

    def along(self, axis: str | None, trial: str | None, plate: str | None = None) -> Where:
        """Return the place of a plate (None: all) in a trial (None: all), along a laboratory axis ("x", "z", None).

        An axis with different names in the trials has none here.
        """
        if axis not in _GROUND_AXES:
            return Where(trial=trial, plate=plate)
        known = [axes for name, axes in self._axes.items() if trial in (None, name)]
        named = [axes.named(_GROUND_AXES[axis]) for axes in known]
        distinct = ({names[key] for names in named} for key in ("axis", "file_axis"))
        direction, column = (names.pop() if len(names) == 1 else None for names in distinct)
        return Where(trial=trial, plate=plate, axis=direction, file_axis=column)


def lab_axes(kinematics: Kinematics) -> Axes:
    """Return the axis names of the laboratory in a trial, which here is rotated to face +X."""
    trial = kinematics.trial
    fore_aft = Axes.of(trial.vertical, travel(trial.markers)).fore_aft
    across = round(kinematics.turned_deg / 90.0) % 2 == 1
    return Axes(trial.vertical, 2 - fore_aft if across else fore_aft)
