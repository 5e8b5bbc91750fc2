"""Defines the result of an estimate, `Fit`; its trials are `TrialFit`s."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from kinertia.estimation.identifiability import evidence
from kinertia.estimation.prepared import known
from kinertia.estimation.result.curve_source import Stage
from kinertia.estimation.result.cycles import (
    MOST_STRIDES,
    CurvesByStage,
    Kind,
    curves_by_stage,
    cycle_columns,
    peak_columns,
    phase_columns,
    spatiotemporal_columns,
)
from kinertia.estimation.result.figure_names import FitPictures
from kinertia.estimation.result.gait_scores import GaitProfile, with_norms
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.fit import Posterior
from kinertia.estimation.simultaneous.instruments.instrument_errors import calibration_columns
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import Asymmetry, asymmetries, asymmetry_columns
from kinertia.findings.extensions import report_function
from kinertia.findings.finding import Finding
from kinertia.findings.overview import Overview
from kinertia.io.norms_file import read_norms
from kinertia.model.anthropometry import SEGMENTS
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel
from kinertia.model.skeleton import Skeleton
from kinertia.settings import Settings, Subject

if TYPE_CHECKING:
    import pandas as pd
    from xarray import Dataset


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Body segment parameters of a person, with the trials that they were estimated from.

    Attributes:
        subject: with mass and height filled in.
        settings: as used.
        skeleton: calibrated model.
        literature, estimate: body segment parameters before and after; with an OpenSim model, its own are the former.
        trials: one entry per trial.
        converged: whether the estimator met its criterion.
        posterior: uncertainty and calibration; None after two-level, which has none.
        findings: all of them, with what explains and what overrules each.
        notes: how the trials were prepared; one sentence each.
        file: the OpenSim model that the skeleton is from, or None.
        left_out: names of the trials that could not be used.
        rules: number of rules checked.
        evaluations: number made by the two-level estimate; 0 for the other one.

    Examples:
        >>> mass = fit.bsp[fit.bsp.parameter == "mass"]  # fit = kinertia.fit_subject("subject.toml")
        >>> list(mass.columns)  # doctest: +NORMALIZE_WHITESPACE
        ['segment', 'parameter', 'unit', 'literature', 'estimate', 'prior_sd', 'sd', 'information', 'evidence']
        >>> fit.save("results").name
        'results'
    """

    subject: Subject
    settings: Settings
    skeleton: Skeleton
    literature: BodySegmentParameters
    estimate: BodySegmentParameters
    trials: tuple[TrialFit, ...]
    converged: bool
    posterior: Posterior | None
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]
    file: OsimModel | None = None
    left_out: tuple[str, ...] = ()
    rules: int = 0
    evaluations: int = 0

    @property
    def overview(self) -> Overview:
        """Summary of the findings: verdict, counts, open findings in order of importance."""
        return Overview(self.findings, self.rules, len(self.trials) + len(self.left_out), self.left_out)

    @cached_property
    def bsp(self) -> pd.DataFrame:
        """Body segment parameters, one row per segment and parameter: segment, parameter, unit, literature, estimate.

        The simultaneous estimate adds prior_sd, sd (standard deviations before and after), information (variance
        reduction), and evidence: "measured" (information above 0.75), "informed" (0.25 to 0.75) or "assumed" (about as
        uncertain as the literature's).
        """
        import pandas as pd

        return pd.DataFrame(self.bsp_columns())

    @cached_property
    def evidence(self) -> np.ndarray:
        """How well the data inform each parameter (s, 10), as in `bsp`; no rows after two-level."""
        information = np.empty((0, 10)) if self.posterior is None else self.posterior.information
        return np.array([[evidence(value) for value in row] for row in information], dtype=object).reshape(-1, 10)

    def bsp_columns(self) -> dict[str, Any]:
        """Return the columns of `bsp`, by name."""
        columns = self.literature.columns()
        columns["literature"], columns["estimate"] = columns.pop("value"), self.estimate.columns()["value"]
        if self.posterior is None:
            return columns
        of_posterior = {name: getattr(self.posterior, name).ravel() for name in ("prior_sd", "sd", "information")}
        return {**columns, **of_posterior, "evidence": self.evidence.ravel().tolist()}

    @cached_property
    def curves(self) -> CurvesByStage:
        """Curves by stage over strides, at most 100 per trial and side, and over `contact_phases`, computed once."""
        return curves_by_stage(self.trials, self.mass_kg, MOST_STRIDES)

    def with_trials(self, kept: Sequence[int]) -> Self:
        """Return the fit with these of its trials alone, and their curves where they are known."""
        part = replace(self, trials=tuple(self.trials[k] for k in kept))
        if "curves" in vars(self):
            names = {trial.name for trial in part.trials}
            vars(part)["curves"] = {
                stage: [curve for curve in curves if curve.trial in names] for stage, curves in self.curves.items()
            }
        return part

    def cycles(self, stage: Stage = "estimate", norms: str | Path | None = None) -> pd.DataFrame:
        """Return curves over the gait cycle, one row per trial, side, stride, percent (0 to 100) and quantity.

        Columns: trial, task ("walk", "turn", ...), side ("r", "l": whose heel strikes begin and end the stride), stride
        (from 1), percent, quantity, value, sd. Average only strides of one task.

        Quantities: "..._angle" (deg), "..._moment" (N m/kg, internal, signed like the angle),
        "..._power" (W/kg), each of a coordinate without its side; "knee_adduction_joint_moment", ... (N m/kg, of
        `joint_moments`); "ground_force_forward", "..._upward", "..._medial" (% body weight; along the stride, up,
        towards the other foot); "..._clinical": Plug-in Gait's nine angles (deg). What is not known is NaN.

        Args:
            stage: "estimate", or "literature": inverse kinematics and inverse dynamics without the estimate.
            norms: CSV file of norms; adds the columns norm, norm_sd, gvs and gps, the stride's scores (deg; see `gps`).

        Examples:
            >>> cycles = fit.cycles()
            >>> knee = cycles[(cycles.quantity == "knee_angle_moment") & (cycles.side == "r")]
            >>> mean = knee.groupby("percent")["value"].mean()
            >>> len(mean)
            101
        """
        import pandas as pd

        columns = cycle_columns(self.trials, self.mass_kg, stage)
        return pd.DataFrame(columns if norms is None else with_norms(columns, read_norms(norms), self.skeleton))

    def contact_phases(self, stage: Stage = "estimate") -> pd.DataFrame:
        """Return curves over contacts with plates that are part of no stride, in the columns of `cycles`, and `phase`.

        Phases: "stance", from foot contact to foot off, where no heel strike follows; "landing", in trials of that
        task, from foot contact until the pelvis is lowest. `percent` is of the phase; `stride` counts the phases of a
        side.

        Args:
            stage: as in `cycles`.

        Examples:
            >>> list(fit.contact_phases().columns)[:4]
            ['trial', 'task', 'phase', 'side']
        """
        import pandas as pd

        curves = curves_by_stage(self.trials, self.mass_kg, 0, [stage])[stage]
        return pd.DataFrame(phase_columns(curves))

    @cached_property
    def peaks(self) -> pd.DataFrame:
        """Peaks and impulses of joint moments and powers, one row per trial, side, phase and peak.

        Columns: trial, task, phase ("stride"; or "stance", "landing", as in `contact_phases`), side, stride, peak,
        unit, value, sd, percent (of the phase). Values are positive in the direction that `peak` states, NaN unless all
        of it is known. Empty in squats, and after two-level.

        Examples:
            >>> first = fit.peaks[fit.peaks.peak == "knee adduction moment, external, first peak"]
            >>> list(first.unit.unique()), list(first.columns)[-3:]
            (['N m/kg'], ['value', 'sd', 'percent'])
        """
        import pandas as pd

        return pd.DataFrame(self.peak_columns())

    def peak_columns(self) -> dict[str, Any]:
        """Return the columns of `peaks`, by name."""
        trials = [trial for trial in self.trials if trial.joint_curves is not None]
        return peak_columns(curves_by_stage(trials, self.mass_kg, None, ("estimate",))["estimate"])

    @property
    def spatiotemporal(self) -> pd.DataFrame:
        """One row per stride: times, speed, cadence, lengths, step width, stance and double support.

        `on_plates`: whether plates measured both heel strikes; for the others see `kinertia.motion.spatiotemporal`.
        """
        import pandas as pd

        return pd.DataFrame(spatiotemporal_columns(self.trials))

    @property
    def expected(self) -> BodySegmentParameters:
        """Mean of the prior: the literature's or the model's parameters, unless more was known."""
        return self.literature if self.posterior is None else self.posterior.prior_mean

    @property
    def more_known(self) -> bool:
        """Whether the prior's mean differs from the literature or the model."""
        return not np.array_equal(self.expected.table(), self.literature.table())

    @property
    def expected_source(self) -> str:
        """Source of the expected parameters: "the prior", "the literature" or "the model's own values"."""
        if self.more_known:
            return "the prior"
        return "the literature" if self.file is None else "the model's own values"

    @cached_property
    def estimated_rows(self) -> np.ndarray:
        """Rows of the segments that were estimated; those with a prior SD of 0 stay as the model has them."""
        if self.posterior is None:
            return np.arange(len(self.estimate.segments))
        return np.flatnonzero((self.posterior.prior_sd > 0).any(axis=1))

    @cached_property
    def departures(self) -> np.ndarray | None:
        """Estimate minus the prior's mean (s, 10) in prior SDs, 0 where fixed; None after two-level."""
        if self.posterior is None:
            return None
        scale = np.where(self.posterior.prior_sd > 0, self.posterior.prior_sd, np.inf)
        result: np.ndarray = (self.estimate.table() - self.expected.table()) / scale
        return result

    @property
    def mass_kg(self) -> float:
        """Stated body mass, kg."""
        return known(self.subject.mass_kg)

    @property
    def attached_kg(self) -> float:
        """Estimated mass (kg) of the objects that the person wore or carried, which are extra segments."""
        bodies = SEGMENTS if self.file is None else self.file.bsp.segments
        rows = zip(self.estimate.segments, self.estimate.mass_kg.tolist(), strict=True)
        return float(sum(mass for segment, mass in rows if segment not in bodies))

    def save(self, folder: str | Path, force: bool = False) -> Path:
        """Write all result files into a folder, with several trials a sub-folder for each, and return the folder.

        Args:
            folder: created if necessary.
            force: write even among files that are not results of Kinertia; one with the name of a result is refused.

        Raises:
            FileError: the folder holds such files, or cannot be written to.
        """
        written: Path = report_function("saved")(self, folder, force)
        return written

    def figure(self, name: str, path: str | Path, trial: str | None = None) -> Path:
        """Draw a figure for a paper into a file (180 mm wide, three panels in a row), and return the file.

        Args:
            name: as in `plot`: "moments", "angles", "powers", "forces", "cycles", "coordinates", "residuals", "bsp" or
                "departures".
            path: .svg, .pdf, .eps, .png or .tif.
            trial: for moments, angles, coordinates and residuals: draw this trial, over time.

        Raises:
            KinertiaError: no such figure or trial, no strides or error bars to draw it from, or matplotlib (the extra
                `plots`) is missing.
            FileError: the format is not known, or the file cannot be written.
        """
        written: Path = report_function("save_figure")(self, name, path, trial)
        return written

    def to_xarray(self, kind: Kind = "moment", over: Literal["percent", "time"] = "percent") -> Dataset:
        """Return curves of all trials as an xarray Dataset with variables `value` and `sd`, units as their attributes.

        Coordinates: trial, side, stride, percent, joint over the gait cycle; trial, time, joint over time. Values that
        were not measured are NaN. `to_netcdf` writes the Dataset.

        Args:
            kind: "angle", "clinical" (deg), "moment", "joint_moment" (N m/kg; over time N m), "power", "force".
            over: "percent" of the gait cycle, or "time" (s; angles, moments and joint moments).

        Raises:
            KinertiaError: xarray (the extra `xarray`) is missing, there are no such curves, or no strides.

        Examples:
            >>> knee = fit.to_xarray("moment").sel(joint="knee_angle", side="r")
            >>> knee.value.attrs["units"]
            'N m/kg'
        """
        return report_function("curve_dataset")(self, kind, over)

    def gps(self, norms: str | Path) -> GaitProfile:
        """Compute Gait Profile Score and Movement Analysis Profile (Baker 2009) against norms, in degrees.

        Args:
            norms: CSV file of `kinertia norms`.

        Raises:
            KinertiaError: norms have another convention or lack a variable, or there are no strides.
            FileError: the norms cannot be read.
        """
        result: GaitProfile = report_function("scored")(self, norms)
        return result

    def draws_to_xarray(self, count: int = 50, seed: int = 0) -> Dataset:
        """Return posterior draws as an xarray Dataset with coordinates chain and draw, as ArviZ expects.

        Variables: `angle` (deg) and `moment` (N m) by trial, time and joint; `joint_moment` (N m) by trial, time and
        component ("knee_r_adduction"); `bsp` by segment and parameter. Components of one draw belong together: the
        draws keep their covariance. What is not known is NaN.

        Args:
            count: number of draws; a result stores 200, for long trials fewer.
            seed: selects them.

        Raises:
            KinertiaError: xarray is missing, or fewer draws are stored.
        """
        return report_function("draw_dataset")(self, count, seed)

    @property
    def covariance(self) -> pd.DataFrame | None:
        """Posterior covariance of all body segment parameters, by "segment.parameter"; None after two-level."""
        if self.posterior is None:
            return None
        import pandas as pd

        names = (self.bsp["segment"] + "." + self.bsp["parameter"]).tolist()
        return pd.DataFrame(self.posterior.covariance, index=names, columns=names)

    @cached_property
    def asymmetries(self) -> tuple[Asymmetry, ...]:
        """Differences between the sides, a pair of segments each; none after two-level."""
        return () if self.posterior is None else tuple(asymmetries(self.estimate, self.posterior.covariance))

    @property
    def asymmetry(self) -> pd.DataFrame | None:
        """Right minus left of every pair of segments, with its SD and whether it differs; None after two-level.

        Centres of mass and products of inertia are compared with the mirror image. `differs` is corrected for the ten
        parameters of a pair: it is true by chance in at most 5 % of pairs.
        """
        if self.posterior is None:
            return None
        import pandas as pd

        return pd.DataFrame(asymmetry_columns(self.asymmetries))

    @property
    def calibration(self) -> pd.DataFrame | None:
        """Calibrated quantities of instruments, joints and trunk, one row each, SI units; None after two-level.

        For instruments (kind "plate" or "synchronisation") the value is the error, recorded minus true; for joints it
        is the change, estimate minus the model's value.
        """
        import pandas as pd

        return None if self.posterior is None else pd.DataFrame(calibration_columns(self.posterior.calibration))

    @property
    def plot(self) -> FitPictures:
        """Figures for a notebook: `fit.plot.moments()`, `.bsp()`, `.residuals()`, `.skeleton()` and others."""
        pictures: FitPictures = report_function("pictures")(self)
        return pictures

    def __repr__(self) -> str:
        """Return person, method and trials only, since all the arrays would fill pages."""
        trials = ", ".join(trial.name for trial in self.trials)
        return f"Fit({self.subject.name}, {self.mass_kg:.1f} kg, {self.settings.method}; {trials})"

    def _repr_html_(self) -> str:
        """Return the HTML summary for a notebook: verdict, warnings, body segment parameters."""
        html: str = report_function("fit_html")(self)
        return html
