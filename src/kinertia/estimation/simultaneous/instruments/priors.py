"""Defines what the estimate may change besides segments, and priors of plates and synchronisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.instruments.plates import (
    FLOOR_UNKNOWNS,
    PLATE_ERRORS,
    PLATE_UNKNOWNS,
    X,
    Z,
    plates_with_floor,
)
from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import AXIS_TILTS, HIP_OFFSETS, LEG_AXIS_TILTS, LUMBAR_OFFSETS, SHOULDER_OFFSETS
from kinertia.settings import Instruments
from kinertia.trial.trial_input import columns_of_several_trials

FAULT_PROBABILITY = 0.05
PLATE_PRIOR: Mapping[str, FaultMixture] = {
    "x": FaultMixture(0.0005, 0.015, FAULT_PROBABILITY),
    "z": FaultMixture(0.0005, 0.015, FAULT_PROBABILITY),
    "gain": FaultMixture(0.002, 0.03, FAULT_PROBABILITY),
    "free moment": FaultMixture(0.0003, 0.003, FAULT_PROBABILITY),
    "turn": FaultMixture(float(np.radians(0.1)), float(np.radians(3.0)), FAULT_PROBABILITY),
}
"""Names and units as in PLATE_UNKNOWNS. Place: centres of pressure of four commercial plates were off by 2.3, 2.6, 11.8
and 14.0 mm on average (Cedraro et al. 2011, Gait Posture 33:724), part of it a constant; sound plates and others. Gain:
scale and plates of a laboratory may differ by 2 % before it is worth a warning. Free moment: a tenth of a percent of
the vertical force at 0.3 m, and ten times that (no source). Turn: plates are mounted square; a corner that was surveyed
or entered 25 mm beside its place rotates a plate by 3 degrees (no source)."""
FLOOR_PRIOR: Mapping[str, FaultMixture] = {
    "x": FaultMixture(0.0005, 0.015, FAULT_PROBABILITY),
    "z": FaultMixture(0.0005, 0.015, FAULT_PROBABILITY),
    "turn": FaultMixture(float(np.radians(0.3)), float(np.radians(2.0)), 0.2),
}
"""Names and units as in FLOOR_UNKNOWNS: plates and cameras were surveyed in different axes. Place: an origin that is
off displaces all plates by as much as one (PLATE_PRIOR). With 5 mm in place of 15, walks of eight people with both
plates 20 mm off had ankle moments 8.4 instead of 7.4 N m off, 37 instead of 46 % of them in their intervals; where
plates are sound, errors are the same within 2 %. Of four of them, a share of faults of 0.2 covers 84 %, but
costs sound laboratories a third of their ankle moments' accuracy. Turn: with a prior of 5
degrees, walks and runs of eleven laboratories show 0.2 to 0.5 degrees where they show them to half a degree (three),
1.6 and 3.6 degrees in two, and in the others less than their SDs, of 1 to 2 degrees. A frame laid on the floor by eye
is a few degrees askew."""
DELAY_PRIOR_S = FaultMixture(0.0003, 0.005, 0.2, faulty_mean=0.006)
"""Delay of the forces. Where they are synchronous, half a sample of the plates. Otherwise, by 80 recordings of 26
laboratories fitted with a flat prior (SD 20 ms): apparent delays are 4.3 ms with an SD of 4.4 between laboratories, 8.2
where amplifiers are analogue and 2.3 elsewhere, so more often delayed than early. Delays are assumed rarer than among
these: of 20 people with synchronous forces, a prior that expects 3 ms in half of all laboratories makes ankle moments
err by a fifth more. Forces that are 10 ms early are found as well as with a mean of zero."""
SOFT_TISSUE_LAG_S = 0.0003, 0.001
"""Mean and SD of what seems to be a delay and is none: soft tissue lags behind. It is 1.1 ms where skin moves as it was
measured on one person, 0 where it moves with the joints' angles, and in walks of 23 laboratories delays are 1.7 +- 0.9
ms shorter below 4 Hz. Taken for a delay, it makes ankle moments of the first err by a seventh more, with forces on time
or 10 ms late. With a mean of 0.5 ms, ankle moments of the second, with delayed forces, would err by 8 % more."""
TRIAL_DELAY_PRIOR_S = FaultMixture(0.00003, 0.010, 0.04)
"""Delay of one trial, besides the synchronisation delay: cameras and plates that start together do so in every trial;
of two runs on one treadmill, forces of the first are delayed by 8.4 ms and of the second by 13.5. A stated
synchronisation holds for every trial."""
ZERO_PRIOR_N = FaultMixture(1.0, 10.0, FAULT_PROBABILITY)
"""Zero offset of horizontal forces. Unloaded, four plates of published trials read 0.2 to 3 N and a fifth one 12 N;
under people who stand still, two plates together read 2 N."""
TRIAL_GAIN_PRIOR = FaultMixture(0.001, 0.03, 0.3)
"""Gain error of a plate in one trial, besides that in all trials. One person weighed 60 kg standing and squatting, and
63.5 to 64 walking on the same plates of one session: two trials of seven are 4 % off the others."""


@dataclass(frozen=True, eq=False)
class InstrumentInformation:
    """Information of one person's trials on plates and synchronisation.

    There are k = 5 p + 4 unknowns for p plates, the common plate offset and the delay, in this order, each plate's as
    in PLATE_UNKNOWNS, the common ones as in FLOOR_UNKNOWNS. No prior is included.

    Attributes:
        plates: names.
        information: (k, k) of normal equations in m, 1, N m/N, rad and s.
        rhs: (k,) their right-hand side: information times the values from these trials.

    >>> shown = InstrumentInformation(("left",), np.eye(9), np.zeros(9))
    >>> shown.among(("right", "left"), InstrumentPrior()).information.shape
    (14, 14)
    """

    plates: tuple[str, ...]
    information: np.ndarray
    rhs: np.ndarray

    @classmethod
    def of_posterior(
        cls, plates: Sequence[str], mean: np.ndarray, covariance: np.ndarray, before: Sequence[tuple[np.ndarray, ...]]
    ) -> InstrumentInformation:
        """Return what a posterior, mean (k,) and covariance (k, k), adds to prior knowledge.

        `before` holds information and right-hand side of each source of prior knowledge.
        """
        after = np.linalg.inv(covariance)
        information = after - sum(known_information for known_information, _ in before)
        rhs = after @ mean - sum(known_rhs for _, known_rhs in before)
        return cls(tuple(plates), *_never_negative(information, rhs, np.sqrt(np.diag(after))))

    @classmethod
    def of_positions(
        cls,
        plates: Sequence[str],
        on: Sequence[str],
        along: np.ndarray,
        ahead_m: np.ndarray,
        covariance: np.ndarray,
    ) -> InstrumentInformation:
        """Return the information on plate positions from loads that act farther forward than expected.

        Args:
            plates: names.
            on: name of the plate of each of m loads.
            along: (m, 2) unit vectors in the floor's plane (x, z).
            ahead_m: (m,) m along these.
            covariance: (m, m) of what people differ by without displaced plates.
        """
        to_plates = plates_with_floor(len(plates)).reshape(len(plates), len(PLATE_ERRORS), -1)
        places = to_plates[[plates.index(name) for name in on]][:, [X, Z]]
        # unknowns are true minus recorded positions
        rows = -np.pad(np.einsum("mx,mxk->mk", along, places), ((0, 0), (0, 1)))
        weighted = np.linalg.solve(covariance, rows)
        return cls(tuple(plates), rows.T @ weighted, ahead_m @ weighted)

    @classmethod
    def of_one_person(cls, fits: Sequence[InstrumentInformation]) -> InstrumentInformation:
        """Combine fits of trials of one person, each made alone.

        What a person's body makes of the forces seems an error of the plates in all of them: together they show plates
        as one does, the mean weighted by what each shows. Five walks of one person said a vertical moment of 1.7 +- 0.3
        N m/kN by their sum, 1.5 +- 0.6 by a joint estimate, and each 0.6. Delays are known better from several.
        """
        plates = tuple(dict.fromkeys(name for fit in fits for name in fit.plates))
        every = [fit.among(plates, InstrumentPrior()) for fit in fits]
        shown = np.array([np.diag(fit.information) for fit in every])
        weights = (shown / np.maximum(shown.sum(axis=0), np.finfo(float).tiny)).sum(axis=1)
        weights /= weights.sum()
        information = np.tensordot(weights, [fit.information for fit in every], axes=1)
        rhs = weights @ [fit.rhs for fit in every]
        for fit, weight in zip(every, weights, strict=True):
            delay, delay_rhs = fit._on_delay_alone()
            information[-1, -1] += (1.0 - weight) * delay
            rhs[-1] += (1.0 - weight) * delay_rhs
        return cls(plates, information, rhs)

    def _on_delay_alone(self) -> tuple[float, float]:
        """Return information and right-hand side on the delay, whatever the plates' errors are."""
        scale = np.sqrt(np.maximum(np.diag(self.information)[:-1], np.finfo(float).tiny))
        of_plates, across = self.information[:-1, :-1] / np.outer(scale, scale), self.information[:-1, -1] / scale
        through = np.linalg.pinv(of_plates, rcond=1e-9, hermitian=True) @ across
        return (
            float(self.information[-1, -1] - across @ through),
            float(self.rhs[-1] - (self.rhs[:-1] / scale) @ through),
        )

    def without_own(self, sd: np.ndarray) -> InstrumentInformation:
        """Eliminate the t unknowns that are specific to trials, which come last, given their standard deviations (t,).

        They are independent, with a mean of zero.
        """
        size = len(self.rhs) - len(sd)
        across = self.information[:size, size:]
        specific = self.information[size:, size:] + np.diag(1.0 / np.square(sd))
        through = np.linalg.solve(specific, np.column_stack([across.T, self.rhs[size:]]))
        information = self.information[:size, :size] - across @ through[:, :-1]
        return InstrumentInformation(self.plates, information, self.rhs[:size] - across @ through[:, -1])

    def among(self, plates: Sequence[str], prior: InstrumentPrior) -> InstrumentInformation:
        """Convert to these plates; a plate that is not among them contributes no more than its prior."""
        every = tuple(dict.fromkeys([*plates, *self.plates]))
        per_plate = len(PLATE_UNKNOWNS)
        here = np.concatenate([per_plate * every.index(name) + np.arange(per_plate) for name in self.plates]).astype(
            int
        )
        size = per_plate * len(every)
        here = np.concatenate([here, size + np.arange(len(FLOOR_UNKNOWNS) + 1)])
        information, rhs = np.zeros((size + len(FLOOR_UNKNOWNS) + 1,) * 2), np.zeros(size + len(FLOOR_UNKNOWNS) + 1)
        information[np.ix_(here, here)], rhs[here] = self.information, self.rhs
        absent = np.arange(per_plate * len(plates), size)
        kept = np.setdiff1d(np.arange(len(rhs)), absent)
        deviations = np.tile([prior.plate[name].sd for name in PLATE_UNKNOWNS], len(every) - len(plates))
        eliminated = information[np.ix_(absent, absent)] + np.diag(1.0 / np.square(deviations))
        through = np.linalg.solve(eliminated, np.column_stack([information[np.ix_(absent, kept)], rhs[absent]]))
        across = information[np.ix_(kept, absent)]
        return InstrumentInformation(
            tuple(plates),
            information[np.ix_(kept, kept)] - across @ through[:, :-1],
            rhs[kept] - across @ through[:, -1],
        )


def _never_negative(information: np.ndarray, rhs: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Remove directions in which the information, over its scale, is negative.

    They may result from rounding, and from replacing a mixture of two components by one Gaussian.
    """
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = vectors[:, values > 0.0]
    scaled = kept * scale[:, None]
    return scaled * values[values > 0.0] @ scaled.T, scale * (kept @ (kept.T @ (rhs / scale)))


@dataclass(frozen=True, eq=False)
class InstrumentPrior:
    """Prior knowledge of plates and synchronisation, before a person's trials.

    Attributes:
        plate: prior of each of PLATE_UNKNOWNS, for every plate on its own.
        floor: prior of each of FLOOR_UNKNOWNS, for all plates together.
        delay_s: prior of the delay between forces and markers.
        trial_delay_s: prior of the additional delay of the forces of one of several trials.
        zero_offset_n: prior of the zero offsets of each plate's horizontal forces in each trial.
        trial_gain: prior of each plate's additional gain error in each trial.
        session: information from other people measured with the same instruments.
        feet: information of this person's steps, by where they act on the feet; it is part of what the trials show.
        incomplete: plates of whose loads a part is missing: these trials do not show their gains, which stay nominal.

    >>> stated = InstrumentPrior.stated(Instruments(plate_sd_mm=1.0))
    >>> stated.plate["x"].sd, stated.delay_s == InstrumentPrior().delay_s
    (0.001, True)
    """

    plate: Mapping[str, FaultMixture] = field(default_factory=lambda: PLATE_PRIOR)
    floor: Mapping[str, FaultMixture] = field(default_factory=lambda: FLOOR_PRIOR)
    delay_s: FaultMixture = DELAY_PRIOR_S
    trial_delay_s: FaultMixture = TRIAL_DELAY_PRIOR_S
    zero_offset_n: FaultMixture = ZERO_PRIOR_N
    trial_gain: FaultMixture = TRIAL_GAIN_PRIOR
    session: tuple[InstrumentInformation, ...] = ()
    feet: tuple[InstrumentInformation, ...] = ()
    incomplete: frozenset[str] = frozenset()

    @classmethod
    def stated(cls, instruments: Instruments, session: Sequence[InstrumentInformation] = ()) -> InstrumentPrior:
        """Build the prior from the laboratory's statements: what it has checked is normal with that standard deviation.

        The rest is the literature's. A check of the centre of pressure against the cameras covers plate and common
        offset together.
        """
        result = cls(session=tuple(session))
        if instruments.plate_sd_mm is not None:
            place, none = (FaultMixture.certain(mm / 1e3) for mm in (instruments.plate_sd_mm, _NO_FLOOR_MM))
            result = replace(
                result,
                plate={**result.plate, **dict.fromkeys(_PLACE, place)},
                floor={**result.floor, **dict.fromkeys(_PLACE, none)},
            )
        if instruments.gain_sd_percent is not None:
            gain = FaultMixture.certain(instruments.gain_sd_percent / 100.0)
            of_trials = FaultMixture.certain(TRIAL_GAIN_PRIOR.nominal_sd)
            result = replace(result, plate={**result.plate, "gain": gain}, trial_gain=of_trials)
        if instruments.clock_sd_ms is not None:
            delay, of_trial = instruments.clock_sd_ms / 1e3, TRIAL_DELAY_PRIOR_S.nominal_sd
            result = replace(result, delay_s=FaultMixture.certain(delay), trial_delay_s=FaultMixture.certain(of_trial))
        return result

    def of_unknowns(self, plates: Sequence[str]) -> ErrorPriors:
        """Return the priors of all plates' unknowns, the common plate offset's and the delay's.

        Columns of the same name in the force files of several trials count as plates of their own, but are mostly the
        same one: the common part of their faults has a prior, too.
        """
        names = list(PLATE_UNKNOWNS)
        individual = [self._nominal(self.plate[name], plate, name) for plate in plates for name in names]
        common = [
            (FaultMixture(_HARDLY * prior.nominal_sd, prior.faulty_sd, prior.fault_probability), tuple(places))
            for column in columns_of_several_trials(plates)
            for k, prior in enumerate(self.plate[name] for name in names)
            if (places := [len(names) * plate + k for plate in column]) and prior.fault_probability > 0.0
        ]
        floor = [self.floor[name] for name in FLOOR_UNKNOWNS]
        return ErrorPriors((*individual, *floor, self.delay_s), tuple(common))

    def trial_gain_of(self, plate: str) -> FaultMixture:
        """Return the prior of a plate's additional gain error in each trial."""
        return self._nominal(self.trial_gain, plate, "gain")

    def _nominal(self, prior: FaultMixture, plate: str, name: str) -> FaultMixture:
        """Return the prior of an error of a plate, without a fault if incomplete loads would seem to be one."""
        return FaultMixture.certain(prior.nominal_sd) if name == "gain" and plate in self.incomplete else prior

    def of_session(self, plates: Sequence[str]) -> InstrumentInformation:
        """Return the information of the session's other people on these plates, combined."""
        return self._combined(self.session, plates)

    def beside_root(self, plates: Sequence[str]) -> InstrumentInformation:
        """Return all information on these plates that is not from the root equations, combined."""
        return self._combined((*self.session, *self.feet), plates)

    def _combined(self, sources: Sequence[InstrumentInformation], plates: Sequence[str]) -> InstrumentInformation:
        size = len(PLATE_UNKNOWNS) * len(plates) + len(FLOOR_UNKNOWNS) + 1
        information, rhs = np.zeros((size, size)), np.zeros(size)
        for source in sources:
            shown = source.among(plates, self)
            information += shown.information
            rhs += shown.rhs
        return InstrumentInformation(tuple(plates), information, rhs)


_HARDLY = 0.1
"""Fault-free columns have hardly anything in common that they do not have with all plates."""
_PLACE = ("x", "z")
_NO_FLOOR_MM = 0.1
"""Standard deviation of the common plate offset if the plates' positions have been checked against the cameras."""
JOINT_CENTRE_SD_M = 0.010
JOINT_AXIS_SD_RAD = float(np.radians(5.0))
MARKER_SD_M = 0.005
"""The calibrated skeleton has its markers from these trials already; what remains is the error of that calibration."""
MOST_MOVED_M = 0.010
"""What markers are farther from where a model has them was the model's mistake, which adapting them has mended."""
FIXED_AXIS_SD_RAD = float(np.radians(4.0) / np.sqrt(2.0))
"""Of each of two directions in which an axis of knee or ankle that is no unknown may be tilted: 4 degrees together."""
WITHOUT_STATIC = 2.0
"""Factor on the uncertainty of joint centres and markers of a model that is made from a walk."""


@dataclass(frozen=True, eq=False)
class ModelUncertainty:
    """Joint centres, markers and instruments that may change, and segments that are not estimated.

    Attributes:
        centres: static coordinate of the skeleton (locked) -> prior standard deviation, m.
        marker_sd_m: prior standard deviation of marker positions in their segments, each axis; None: they are fixed.
        fixed: parameters of the segments that are not in the prior; None if it has all.
        source: where the prior's mean comes from, for messages.
        axes: static coordinate that tilts a joint's axis -> prior standard deviation, rad.
        fixed_axes: the same of axes that are no unknowns. Deviations of angles, and of moments about these axes, allow
            for them.
        moved_m: segment -> RMS distance, along each axis, by which its markers have been adapted to the trials.
            Deviations of angles allow for as much.
        instruments: priors of plates and synchronisation.
        before: static coordinate -> its value before the trials changed it; for others the skeleton's.
    """

    centres: Mapping[str, float]
    marker_sd_m: float | None
    fixed: BodySegmentParameters | None
    source: str
    axes: Mapping[str, float] = field(default_factory=dict)
    fixed_axes: Mapping[str, float] = field(default_factory=dict)
    moved_m: Mapping[str, float] = field(default_factory=dict)
    instruments: InstrumentPrior = field(default_factory=InstrumentPrior)
    before: Mapping[str, float] = field(default_factory=dict)

    @property
    def coordinates(self) -> dict[str, float]:
        """All static coordinates that may change -> prior standard deviation, m or rad."""
        return {**self.centres, **self.axes}

    def misplaced_m(self, segment: str) -> float:
        """Return by how much, along each axis, markers of a segment may be off beyond their prior."""
        known = 0.0 if self.marker_sd_m is None else self.marker_sd_m
        moved = min(self.moved_m.get(segment, 0.0), MOST_MOVED_M)
        return float(np.sqrt(max(moved**2 - known**2, 0.0)))

    def with_axes(self) -> Self:
        """Return the uncertainty with the axes of knees, ankles and elbows of the 27-DOF model free."""
        return replace(self, axes=dict.fromkeys(AXIS_TILTS, JOINT_AXIS_SD_RAD))

    def with_fixed_axes(self) -> Self:
        """Return the uncertainty with errors of the axes of knees and ankles of the 27-DOF model that are not free."""
        fixed = {name: FIXED_AXIS_SD_RAD for name in LEG_AXIS_TILTS if name not in self.axes}
        return replace(self, fixed_axes=fixed)

    @property
    def fixed_kg(self) -> float:
        """Mass (kg) of the segments that are not estimated."""
        return 0.0 if self.fixed is None else self.fixed.total_mass_kg

    def whole(self, estimate: BodySegmentParameters) -> BodySegmentParameters:
        """Append the segments that are not estimated to the estimate."""
        if self.fixed is None:
            return estimate
        table = np.concatenate([estimate.table(), self.fixed.table()])
        return BodySegmentParameters.from_table((*estimate.segments, *self.fixed.segments), table)

    def whole_covariance(self, covariance: np.ndarray) -> np.ndarray:
        """Return the covariance (10 s, 10 s) in the order of `whole`, zero for segments that are not estimated."""
        return np.pad(covariance, (0, 0 if self.fixed is None else 10 * len(self.fixed.segments)))


GAIT27_UNCERTAINTY = ModelUncertainty(
    dict.fromkeys((*HIP_OFFSETS, *LUMBAR_OFFSETS, *SHOULDER_OFFSETS), JOINT_CENTRE_SD_M),
    MARKER_SD_M,
    None,
    "the literature",
)
"""Uncertainty of the 27-DOF model: hip, lumbar and shoulder centres, and all markers."""
