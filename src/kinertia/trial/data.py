"""Defines what the files of one trial hold, and what the estimators take from it.

`Recording` holds what was read: markers, force plates and the subject's measurements, before anything is known about
feet or models. `Trial` holds what the estimators use: the same markers, the loads assigned to feet, and for every
marker frame whether ground contact was measured. `kinertia.trial.plate_assignment` makes it from a `Recording`.
Everything is in SI units and in the ground frame: X forward, Y up, Z right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cached_property

import numpy as np
import numpy.typing as npt

from kinertia.errors import MarkerSetError, TrialError
from kinertia.findings.extensions import report_function
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.trial.file_contents import Belt, FileEvent, FileOutputs, StatedContact, TorqueColumns
from kinertia.trial.plate_signals import ForceSpike, UnloadedReading
from kinertia.trial.sampled_data import impossible_markers, impossible_plates, nearest_samples, windows, within

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

FEET = ("r", "l")
"""Order of the foot axis of `FootLoads`: index 0 is the right foot, index 1 the left."""

LOAD_THRESHOLD_N = 20.0
"""A plate that carries less than this vertical force counts as unloaded.

Below it the centre of pressure is a ratio of two noise signals (346 m from the origin in one published trial), so the
readers set force and moment of such samples to zero, except where a load begins or ends
(`kinertia.trial.plate_loading`).
"""


@dataclass(frozen=True, eq=False)
class Markers:
    """Marker trajectories.

    Attributes:
        time: (n,) s, uniform.
        labels: the m marker names, each once.
        positions: (n, m, 3) m in ground axes; NaN where a marker was not seen.

    Examples:
        >>> markers = kinertia.Markers(np.arange(3) / 100, ("HEEL", "TOE"), np.zeros((3, 2, 3)))
        >>> markers.rate_hz, markers.select(["TOE"]).positions.shape
        (100.0, (3, 1, 3))
    """

    time: FloatArray
    labels: tuple[str, ...]
    positions: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", np.asarray(self.time))
        object.__setattr__(self, "labels", tuple(self.labels))
        _expect_shape("positions", self.positions, (len(self.time), len(self.labels), 3))
        if len(set(self.labels)) != len(self.labels):
            raise ValueError("marker labels must differ from each other")

    @property
    def rate_hz(self) -> float:
        """Frames per second; NaN for a single frame."""
        if len(self.time) < 2:
            return float("nan")
        return round(float((len(self.time) - 1) / (self.time[-1] - self.time[0])), 9)

    @cached_property
    def seen(self) -> BoolArray:
        """Visibility (n, m) of each marker in each frame, bool."""
        return np.asarray(np.isfinite(self.positions).all(axis=2))

    def cut(self, start_s: float, end_s: float) -> Markers:
        """Return the frames with start_s <= time <= end_s."""
        keep = within(self.time, start_s, end_s)
        return Markers(self.time[keep], self.labels, self.positions[keep])

    def select(self, labels: Sequence[str]) -> Markers:
        """Return these markers only, in this order.

        Raises:
            MarkerSetError: L104, a label is not among the markers; the most similar labels are listed.
        """
        missing = [label for label in labels if label not in self.labels]
        if missing:
            nearest = {label: get_close_matches(label, self.labels, n=3) for label in missing}
            hints = "; ".join(f"'{label}' (nearest: {', '.join(near) or 'none'})" for label, near in nearest.items())
            likely = Quantity(", ".join(nearest[missing[0]]) or "none")
            found = finding("L104", Where(markers=tuple(missing)), label=Quantity(missing[0]), nearest=likely)
            problem = f"the trial has no marker {hints}; give labels that are among its {len(self.labels)} markers"
            raise MarkerSetError(problem, missing, nearest).with_finding(found)
        columns = [self.labels.index(label) for label in labels]
        return Markers(self.time, tuple(labels), self.positions[:, columns])

    def arranged(self, labels: Sequence[str]) -> FloatArray:
        """Return positions (n, len(labels), 3) m in the order of the labels; NaN for a label that is missing."""
        positions = np.full((len(self.time), len(labels), 3), np.nan)
        for column, label in enumerate(labels):
            if label in self.labels:
                positions[:, column] = self.positions[:, self.labels.index(label)]
        return positions

    def rotated(self, rotation: FloatArray) -> Markers:
        """Return the same markers in axes rotated by `rotation` (3, 3): new = rotation @ old."""
        return replace(self, positions=self.positions @ rotation.T)


@dataclass(frozen=True, eq=False)
class PlateLoads:
    """Loads measured by p force plates (or column groups of a force file).

    Attributes:
        time: (k,) s, on the time base of the markers.
        names: the p plate names.
        force: (k, p, 3) N, the force ON THE PERSON, in ground axes.
        moment: (k, p, 3) N m, its moment about the ground origin, in ground axes.
        declared_feet: for each plate "r" or "l" where file or column names state it, else None. The loads file may be
            wrong: `kinertia.trial.plate_assignment` decides from the data.
        corners: (p, 4, 3) m, or None where the file has none.
        noise_n: standard deviation of each plate's vertical force while it is unloaded, N; None where it is unknown.
        unloaded: reading of each plate while it was unloaded, before that was subtracted; None where it is unknown.
        spikes: spikes of each plate that its reader has bridged; None where it looked for none.
        torques: content of each plate's torque columns; None where the file has no points and torques.

    Examples:
        >>> force, moment = np.zeros((5, 1, 3)), np.zeros((5, 1, 3))
        >>> force[:, 0, 1] = 700.0
        >>> plates = kinertia.PlateLoads(np.arange(5) / 1000, ("plate 1",), force, moment, declared_feet=(None,))
        >>> float(plates.force[:, :, 1].max())
        700.0
    """

    time: FloatArray
    names: tuple[str, ...]
    force: FloatArray
    moment: FloatArray
    declared_feet: tuple[str | None, ...]
    corners: FloatArray | None = None
    noise_n: tuple[float, ...] | None = None
    unloaded: tuple[UnloadedReading, ...] | None = None
    spikes: tuple[tuple[ForceSpike, ...], ...] | None = None
    torques: tuple[TorqueColumns, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", np.asarray(self.time))
        object.__setattr__(self, "names", tuple(self.names))
        shape = (len(self.time), len(self.names), 3)
        _expect_shape("force", self.force, shape)
        _expect_shape("moment", self.moment, shape)
        if len(self.declared_feet) != len(self.names):
            raise ValueError(f"{len(self.names)} plates but {len(self.declared_feet)} declared feet")
        if self.corners is not None:
            _expect_shape("corners", self.corners, (len(self.names), 4, 3))

    @property
    def wrench(self) -> FloatArray:
        """Force and moment of each plate (k, p, 6), N and N m."""
        return np.concatenate([self.force, self.moment], axis=-1)

    def cut(self, start_s: float, end_s: float) -> PlateLoads:
        """Return the samples with start_s <= time <= end_s."""
        keep = within(self.time, start_s, end_s)
        return replace(self, time=self.time[keep], force=self.force[keep], moment=self.moment[keep])


@dataclass(frozen=True, eq=False)
class Recording:
    """Everything read from the files of one trial, independent of models and marker sets.

    Attributes:
        name: the trial's name, from the marker file.
        markers: the marker trajectories.
        plates: the force plates, or None where no forces were recorded (statics need none).
        mass_kg: body mass if the file states it, else None.
        height_m: body height if the file states it, else None.
        measurements: further lengths of the subject in m, by the file's own keys (`LKneeWidth`).
        findings: what was detected and assumed while reading.
        length_unit: of the marker file ("mm"); everything here is in m.
        vertical: the marker file's axis that points up ("+Z"); here it is +Y.
        virtual_sd_m: label -> standard deviation (m) of each coordinate, for virtual markers: computed, not attached.
        belt: the treadmill's, where its speed is stated.
        events: gait events stated in the file, in order of time.
        outputs: angles, moments and powers that other software left in the file, if any.
        stated_contacts: whose foot loads are, where the user states it.

    Raises:
        TrialError: times do not increase evenly, marker positions are infinite, forces are not numbers, or two plates
            share a name.

    Examples:
        >>> recording = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> recording.name, recording.plates.names
        ('walk', ('1_ground_force', '2_ground_force'))
    """

    name: str
    markers: Markers
    plates: PlateLoads | None = None
    mass_kg: float | None = None
    height_m: float | None = None
    measurements: dict[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    length_unit: str = "m"
    vertical: str = "+Y"
    virtual_sd_m: Mapping[str, float] = field(default_factory=dict)
    belt: Belt | None = None
    events: tuple[FileEvent, ...] = ()
    outputs: FileOutputs | None = None
    stated_contacts: tuple[StatedContact, ...] = ()

    def __post_init__(self) -> None:
        markers, plates = self.markers, self.plates
        wrong = impossible_markers(markers.time, markers.labels, markers.positions)
        if wrong is None and plates is not None:
            wrong = impossible_plates(plates.time, plates.names, plates.declared_feet, plates.wrench)
        if wrong is not None:
            raise TrialError.of(self.name, wrong)

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions and corrections made while reading, one sentence each."""
        notes = [reported for reported in self.findings if reported.severity < Severity.WARNING]
        return tuple(f"{note.where.file or self.name}: {note.message}" for note in notes)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Reasons why plates in the file cannot be used, one per plate."""
        return tuple(reported.message for reported in self.findings if reported.code == "F151")

    def without_markers(self, labels: Sequence[str]) -> Recording:
        """Return the recording without these markers.

        Raises:
            MarkerSetError: L104, it has no such marker.
        """
        self.markers.select(labels)  # which raises
        kept = [label for label in self.markers.labels if label not in labels]
        return replace(self, markers=self.markers.select(kept)) if labels else self

    def without_empty_markers(self) -> Recording:
        """Return the recording without markers that no frame shows, with a finding M101 for each of them."""
        seen = self.markers.seen
        labels = [label for column, label in enumerate(self.markers.labels) if seen[:, column].any()]
        if len(labels) == len(self.markers.labels):
            return self
        empty = [
            finding("M101", Where(trial=self.name, markers=(label,)), share=Quantity(0.0, "1"))
            for label in self.markers.labels
            if label not in labels
        ]
        return replace(self, markers=self.markers.select(labels), findings=(*self.findings, *empty))

    def _repr_html_(self) -> str:
        """Return the HTML summary for a notebook: frames, markers and their gaps, force plates, notes."""
        return str(report_function("recording_html")(self))


@dataclass(frozen=True, eq=False)
class FootLoads:
    """Ground reactions on each foot.

    Attributes:
        time: (k,) s, on the time base of the markers.
        force: (k, 2, 3) N on the person in ground axes; index 0 right foot, 1 left foot.
        moment: (k, 2, 3) N m about the ground origin, in ground axes.
        plates: names of the plates.
        on_plate: (k, 2) index of the plate that each foot stands on, or is nearest in time to standing on; left out
            where each foot has a plate of its own.
        noise_n: standard deviation of the vertical force of the noisiest plate while unloaded, N.
        on_shared_plate: (k,) True where both feet stand on one plate, whose load is assigned to one of them; left out
            where they never do.
        corners: (p, 4, 3) m of every plate, or None where the files have none.

    Examples:
        >>> loads = fit.trials[0].kinematics.trial.loads  # right foot, left foot
        >>> loads.wrench.shape[1:]
        (2, 6)
    """

    time: FloatArray
    force: FloatArray
    moment: FloatArray
    plates: tuple[str, ...] = ("right foot", "left foot")
    on_plate: npt.NDArray[np.int_] | None = None
    noise_n: float = 0.0
    on_shared_plate: BoolArray | None = None
    corners: FloatArray | None = None

    def __post_init__(self) -> None:
        shape = (len(self.time), 2, 3)
        _expect_shape("force", self.force, shape)
        _expect_shape("moment", self.moment, shape)
        if self.on_plate is not None:
            _expect_shape("on_plate", self.on_plate, shape[:2])

    @property
    def plate_index(self) -> npt.NDArray[np.int_]:
        """Index (k, 2) of the plate that each foot stands on."""
        return np.tile([0, 1], (len(self.time), 1)) if self.on_plate is None else self.on_plate

    @property
    def wrench(self) -> FloatArray:
        """Force and moment on each foot (k, 2, 6), N and N m."""
        return np.concatenate([self.force, self.moment], axis=-1)

    def rotated(self, rotation: FloatArray) -> FootLoads:
        """Return the same loads in axes rotated by `rotation` (3, 3): new = rotation @ old."""
        corners = None if self.corners is None else self.corners @ rotation.T
        return replace(self, force=self.force @ rotation.T, moment=self.moment @ rotation.T, corners=corners)


@dataclass(frozen=True, eq=False)
class Trial:
    """One trial as the estimators use it.

    Attributes:
        name: the trial's name.
        markers: the marker trajectories, n frames.
        loads: the loads of the two feet, in their own (usually faster) time base.
        measured: (n,) True where every foot on the ground stood on a loaded plate.
        leg_known, on_ground: (n, 2) whether the load on the right, left foot is known (None: as `measured`), and
            whether the foot is on the ground, on a plate or not (None if unknown).
        notes: one sentence for each assumption made so far.
        virtual_sd_m, belt, vertical, events, outputs: as the recording's.
        findings: about the assignment of loads to feet.
        task, condition: what the person does (`trial_input.Task`), and under which condition; empty where not asked.

    Examples:
        >>> recording = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> feet = kinertia.choose_marker_set(recording.markers.labels).foot_labels()
        >>> worn = {side: [one for one in labels if one in recording.markers.labels] for side, labels in feet.items()}
        >>> trial = kinertia.build_trial(recording, worn)
        >>> bool(trial.measured.any())
        True
    """

    name: str
    markers: Markers
    loads: FootLoads
    measured: BoolArray
    notes: tuple[str, ...] = ()
    virtual_sd_m: Mapping[str, float] = field(default_factory=dict)
    belt: Belt | None = None
    findings: tuple[Finding, ...] = ()
    vertical: str = "+Y"
    events: tuple[FileEvent, ...] = ()
    outputs: FileOutputs | None = None
    leg_known: BoolArray | None = None
    on_ground: BoolArray | None = None
    task: str = ""
    condition: str = ""

    def __post_init__(self) -> None:
        _expect_shape("measured", self.measured, (len(self.markers.time),))

    @property
    def known_legs(self) -> BoolArray:
        """`leg_known` of any trial: where all contact is measured, both legs are known."""
        return np.asarray(self.measured[:, None] | (np.zeros(2, bool) if self.leg_known is None else self.leg_known))

    def windows(self) -> list[tuple[float, float]]:
        """Return first and last time (s) of every contiguous run of measured frames, longest run first."""
        return windows(self.markers.time, self.measured)

    def total_force_windows(self) -> list[tuple[float, float]]:
        """Return windows (s) in which the sum of all loads is known, longest first; both feet may be on one plate."""
        if self.loads.on_shared_plate is None:
            return self.windows()
        on_shared_plate = self.loads.on_shared_plate[nearest_samples(self.loads.time, self.markers.time)]
        return windows(self.markers.time, self.measured | on_shared_plate)

    def _repr_html_(self) -> str:
        """Return the HTML summary for a notebook: frames, markers and their gaps, measured windows, notes."""
        return str(report_function("trial_html")(self))

    def rotated(self, rotation: FloatArray) -> Trial:
        """Return the trial, markers, loads and outputs alike, in axes rotated about the vertical: new = rotation @ old.

        Raises:
            ValueError: `rotation` is not a rotation about the vertical (Y) axis.
        """
        proper = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) and np.linalg.det(rotation) > 0
        if not (proper and np.allclose(rotation[1], [0, 1, 0], atol=1e-9)):
            raise ValueError(f"expected a rotation about the vertical (Y) axis, got {np.asarray(rotation).tolist()}")
        outputs = None if self.outputs is None else self.outputs.rotated(rotation)
        markers, loads = self.markers.rotated(rotation), self.loads.rotated(rotation)
        return replace(self, markers=markers, loads=loads, outputs=outputs)


def _expect_shape(name: str, array: npt.NDArray[np.generic], shape: tuple[int, ...]) -> None:
    if np.shape(array) != shape:
        raise ValueError(f"{name} must have shape {shape}, got {np.shape(array)}")
