"""Defines the result of an estimate: `Fit`, with one `TrialFit` for every trial."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from kinertia.estimation.asymmetry import asymmetries, asymmetry_columns
from kinertia.estimation.cycles import Kind, Stage, cycle_columns, spatiotemporal_columns
from kinertia.estimation.fit_pictures import FitPictures
from kinertia.estimation.gait_scores import GaitProfile, with_norms
from kinertia.estimation.identifiability import evidence
from kinertia.estimation.input_checks import known
from kinertia.estimation.simultaneous.calibration_entry import calibration_columns
from kinertia.estimation.simultaneous.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.fit import Posterior
from kinertia.findings.finding import Finding, Severity
from kinertia.findings.overview import Overview
from kinertia.io.norms_file import read_norms
from kinertia.model.anthropometry import SEGMENTS
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.gait_cycle import Stride, strides_of
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.kinematics import Kinematics
from kinertia.settings import Settings, Subject
from kinertia.trial import display

if TYPE_CHECKING:
    import pandas as pd
    from xarray import Dataset


@dataclass(frozen=True, eq=False, repr=False)
class TrialFit:
    """One trial of a `Fit`. Arrays cover the w frames of the measured window.

    Attributes:
        kinematics: markers, coordinates and ground reactions before estimation.
        skeleton: with the markers where they are in this trial (`displacement`).
        motion: coordinates (rad, m) that go with the estimate, and their derivatives as OpenSim's tools will find them
            from `kinematics.mot`: those of natural quintic splines through the frames. They differ from the estimate's
            own in the first and last frames only.
        course: (f, c) coordinates of all frames from the first to the last of these (`kinematics.course_time`), those
            between measured stretches included; None after two-level, which has none there.
        motion_hz: its bandwidth.
        reactions: the ground reactions that go with it, at the plates' rate, of instruments put right.
        residuals: root residual (w, 6: force N, moment N m about the pelvis origin, ground axes) per stage:
            "literature" (no correction), "corrected" (literature BSPs, pelvis correction), "estimate"; forces have the
            bandwidth of the motion.
        full_residuals: the same at the forces' full bandwidth: before the estimate those as measured, after it
            `reactions`. That of the estimate is what OpenSim's inverse dynamics finds on the result files.
        joint_loads: joint inverse dynamics (w, c: N m, N of translations) per stage: "literature" (with forces as
            measured), "estimate" (with `reactions`); of the two-level estimate both with forces of the motion's
            bandwidth. `moments` has them as tables.
        deviations: posterior standard deviations of the estimate's curves; None after two-level. `coordinate_sd` and
            `moment_sd` are tables of them.
        marker_errors_m: distances (w, m) between measured and model markers per stage: "ik", "final".
        seconds: computing time per stage.

    Examples:
        >>> trial = fit.trials[0]  # fit = kinertia.fit_subject("subject.toml")
        >>> trial.moments["estimate"]["knee_angle_r"].name, list(trial.residuals)
        ('knee_angle_r', ['literature', 'corrected', 'estimate'])
    """

    kinematics: Kinematics
    skeleton: Skeleton
    motion: Motion
    motion_hz: float
    reactions: GroundReactions
    residuals: Mapping[str, np.ndarray]
    full_residuals: Mapping[str, np.ndarray]
    joint_loads: Mapping[str, np.ndarray]
    deviations: CurveDeviations | None
    marker_errors_m: Mapping[str, np.ndarray]
    seconds: Mapping[str, float]
    course: np.ndarray | None = None

    @property
    def name(self) -> str:
        """The trial's name."""
        return self.kinematics.trial.name

    @property
    def time(self) -> np.ndarray:
        """(w,) s."""
        return self.kinematics.time

    @property
    def coordinates(self) -> pd.DataFrame:
        """Coordinates of the estimate (rad, m) over time."""
        return by_coordinate(self.kinematics, self.motion.q)

    @cached_property
    def coordinate_sd(self) -> pd.DataFrame | None:
        """Their posterior deviations, in the same form; None after two-level."""
        return None if self.deviations is None else by_coordinate(self.kinematics, self.deviations.coordinates)

    @cached_property
    def strides(self) -> tuple[Stride, ...]:
        """Strides of the whole trial, by plates where they saw the foot land, else by the motion; none in squats."""
        return strides_of(self.skeleton, self.kinematics)

    @cached_property
    def moments(self) -> Mapping[str, pd.DataFrame]:
        """`joint_loads` over time, one column per coordinate."""
        return {stage: by_coordinate(self.kinematics, loads) for stage, loads in self.joint_loads.items()}

    @cached_property
    def moment_sd(self) -> pd.DataFrame | None:
        """Posterior deviations of those of the estimate, in the same form; None after two-level."""
        return None if self.deviations is None else by_coordinate(self.kinematics, self.deviations.moments)

    def __repr__(self) -> str:
        """Name, time and size: all its arrays would fill pages."""
        start, end = self.kinematics.window_s
        return f"TrialFit({self.name}: {start:.2f} to {end:.2f} s, {len(self.time)} frames)"

    def _repr_html_(self) -> str:
        """What a notebook shows: frames used, distances of the markers, residuals."""
        return display.html(self)


def by_coordinate(kinematics: Kinematics, values: np.ndarray) -> pd.DataFrame:
    """Values (w, c) of all coordinates over the measured window's time (s), a column per coordinate."""
    import pandas as pd

    index = pd.Index(kinematics.time, name="time")
    return pd.DataFrame(values, index=index, columns=list(kinematics.ik.coordinates))


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Body segment parameters of a person, and what they were estimated from.

    Attributes:
        subject: with mass and height filled in.
        settings: as used.
        skeleton: calibrated model.
        literature, estimate: body segment parameters before and after; before, those of an OpenSim model are its own.
        trials: one entry per trial.
        converged: whether the estimator met its criterion.
        posterior: error bars and calibration; None after two-level, which has none.
        findings: all of them, with what explains and what overrules each.
        notes: how the trials were prepared; one sentence each.
        file: the OpenSim model that the skeleton is from, if it is.
        left_out: names of the trials that could not be used.
        rules: how many rules were asked.
        evaluations: of the two-level estimate; 0 of the other one.

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
        """What the findings come to: verdict, counts, what is open in order of importance."""
        return Overview(self.findings, self.rules, len(self.trials) + len(self.left_out), self.left_out)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Messages of open ERRORs and WARNINGs; deprecated: use `findings`."""
        return tuple(one.line() for one in self.overview.open if one.severity >= Severity.WARNING)

    @property
    def corrections(self) -> tuple[str, ...]:
        """Messages of what was found and corrected; deprecated: use `findings`."""
        return tuple(one.line() for one in self.overview.open if one.severity is Severity.CORRECTED)

    @cached_property
    def bsp(self) -> pd.DataFrame:
        """One row per segment and parameter: segment, parameter, unit, literature, estimate.

        The simultaneous estimate adds prior_sd, sd (deviations before and after), information, and evidence:
        "measured" (information above 0.75), "informed" (0.25 to 0.75) or "assumed" (about as
        uncertain as the literature's).
        """
        import pandas as pd

        return pd.DataFrame(self.bsp_columns())

    def bsp_columns(self) -> dict[str, Any]:
        """The columns of `bsp`, by name."""
        columns = self.literature.columns()
        columns["literature"], columns["estimate"] = columns.pop("value"), self.estimate.columns()["value"]
        if self.posterior is None:
            return columns
        of_posterior = {name: getattr(self.posterior, name).ravel() for name in ("prior_sd", "sd", "information")}
        return {**columns, **of_posterior, "evidence": [evidence(value) for value in of_posterior["information"]]}

    def cycles(self, stage: Stage = "estimate", norms: str | Path | None = None) -> pd.DataFrame:
        """Curves over the gait cycle, one row per trial, side, stride, percent (0 to 100) and quantity.

        Columns: trial, side ("r", "l": whose heel strikes begin and end the stride), stride (from 1), percent,
        quantity, value, sd. Quantities: "..._angle" (deg), "..._moment" (N m/kg, internal, positive as the angle
        grows), "..._power" (W/kg), each of a coordinate without its side; "ground_force_forward", "..._upward",
        "..._medial" (% body weight; along the stride, up, towards the other foot); "..._clinical": Plug-in Gait's nine
        angles (deg). Where nothing was measured `value` is NaN. `sd` is the posterior deviation.

        Args:
            stage: "estimate", or "literature": what inverse kinematics and inverse dynamics give without the estimate.
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

    @property
    def spatiotemporal(self) -> pd.DataFrame:
        """One row per stride: its times, speed, cadence, lengths, step width, stance and double support.

        `on_plates` says whether plates saw both heel strikes; see `kinertia.motion.spatiotemporal` for the others.
        """
        import pandas as pd

        return pd.DataFrame(spatiotemporal_columns(self.trials))

    @property
    def expected(self) -> BodySegmentParameters:
        """What the estimate leant on: the prior's mean, which is the literature or the model unless more was known."""
        stated = None if self.posterior is None else self.posterior.prior_mean
        return self.literature if stated is None else stated

    @property
    def more_known(self) -> bool:
        """Whether the prior's mean is another than the literature's or the model's."""
        return not np.array_equal(self.expected.table(), self.literature.table())

    @property
    def mass_kg(self) -> float:
        """Body mass as stated."""
        return known(self.subject.mass_kg)

    @property
    def attached_kg(self) -> float:
        """Mass, as estimated, of what the person wore or carried: of segments that are none of the model's."""
        own = SEGMENTS if self.file is None else self.file.bsp.segments
        rows = zip(self.estimate.segments, self.estimate.mass_kg.tolist(), strict=True)
        return float(sum(mass for segment, mass in rows if segment not in own))

    def save(self, folder: str | Path, force: bool = False) -> Path:
        """Write all result files into a folder, as `kinertia.save_fit` does; returns the folder.

        Args:
            folder: is made if need be.
            force: also among files that are not results of Kinertia; those of the same names are replaced.

        Raises:
            FileError: the folder holds such files, or cannot be written to.
        """
        return display.save(self, folder, force=force)

    def figure(self, name: str, path: str | Path, trial: str | None = None) -> Path:
        """Draw a figure for a paper into a file: 180 mm wide, three panels in a row; returns the file.

        Args:
            name: as in `plot`: "moments", "angles", "powers", "forces", "cycles", "coordinates", "residuals", "bsp" or
                "departures".
            path: .svg, .pdf, .eps, .png or .tif.
            trial: of moments, angles, coordinates and residuals: this trial's, over time.

        Raises:
            KinertiaError: no such figure or trial, no strides or error bars to draw it from, or matplotlib (the extra
                `plots`) is missing.
            FileError: a format that is not known, or the file cannot be written.
        """
        return display.figure(self, name, path, trial)

    def to_xarray(self, kind: Kind = "moment", over: Literal["percent", "time"] = "percent") -> Dataset:
        """Curves of all trials as an xarray Dataset with variables `value` and `sd`, units as their attributes.

        Coordinates: trial, side, stride, percent, joint over the gait cycle; trial, time, joint over time. What was
        not measured is NaN. `to_netcdf` writes it.

        Args:
            kind: "angle", "clinical" (deg), "moment" (N m/kg; over time N m), "power" (W/kg), "force" (% body weight).
            over: "percent" of the gait cycle, or "time" (s; angles and moments).

        Raises:
            KinertiaError: xarray (the extra `xarray`) is missing, there are no such curves, or no strides.

        Examples:
            >>> knee = fit.to_xarray("moment").sel(joint="knee_angle", side="r")
            >>> knee.value.attrs["units"]
            'N m/kg'
        """
        result: Dataset = display.dataset(self, kind, over)
        return result

    def gps(self, norms: str | Path) -> GaitProfile:
        """Gait Profile Score and Movement Analysis Profile (Baker 2009) against norms, in degrees.

        Args:
            norms: CSV file of `kinertia norms`.

        Raises:
            KinertiaError: norms of another convention or without a variable, or there are no strides.
            FileError: the norms cannot be read.
        """
        result: GaitProfile = display.gait_profile(self, norms)
        return result

    def draws_to_xarray(self, count: int = 50, seed: int = 0) -> Dataset:
        """Posterior draws as an xarray Dataset with coordinates chain and draw, as ArviZ takes them.

        Variables: `angle` (deg) and `moment` (N m) by trial, time and joint; `bsp` by segment and parameter.

        Args:
            count: of draws; a result keeps 200, of long trials fewer.
            seed: chooses which.

        Raises:
            KinertiaError: xarray is missing, or not so many draws are kept.
        """
        result: Dataset = display.draws(self, count, seed)
        return result

    @property
    def covariance(self) -> pd.DataFrame | None:
        """Posterior covariance of all body segment parameters, by "segment.parameter"; None after two-level."""
        if self.posterior is None:
            return None
        import pandas as pd

        names = (self.bsp["segment"] + "." + self.bsp["parameter"]).tolist()
        return pd.DataFrame(self.posterior.covariance, index=names, columns=names)

    @property
    def asymmetry(self) -> pd.DataFrame | None:
        """Right minus left of every pair of segments, with its deviation and whether it differs; None after two-level.

        Centres of mass and products of inertia are compared with the mirror image. `differs` allows for the ten
        parameters of a pair: by chance in 5 % of pairs at most.
        """
        if self.posterior is None:
            return None
        import pandas as pd

        return pd.DataFrame(asymmetry_columns(asymmetries(self.estimate, self.posterior.covariance)))

    @property
    def calibration(self) -> pd.DataFrame | None:
        """A row for each calibrated quantity of instruments, joints and trunk, SI; None after two-level.

        Values of instruments (kind "plate" or "synchronisation") are errors, recorded minus true; those of joints are
        changes, the estimate minus the model's value.
        """
        import pandas as pd

        return None if self.posterior is None else pd.DataFrame(calibration_columns(self.posterior.calibration))

    @property
    def plot(self) -> FitPictures:
        """Pictures for a notebook: `fit.plot.moments()`, `.bsp()`, `.residuals()`, `.skeleton()` and others."""
        pictures: FitPictures = display.pictures(self)
        return pictures

    def __repr__(self) -> str:
        """Who, how, and from which trials: all its arrays would fill pages."""
        trials = ", ".join(trial.name for trial in self.trials)
        return f"Fit({self.subject.name}, {self.mass_kg:.1f} kg, {self.settings.method}; {trials})"

    def _repr_html_(self) -> str:
        """What a notebook shows: verdict, warnings, body segment parameters."""
        return display.html(self)
