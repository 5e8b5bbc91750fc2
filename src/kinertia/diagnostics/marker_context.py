"""Holds one recording for its checks, with what its markers show by themselves; names axes as the laboratory does."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self, TypedDict

import numpy as np

from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory, foot_trajectories
from kinertia.diagnostics.evidence.landmarks import CLEAR, headings, landmark_positions, most_forwards
from kinertia.diagnostics.evidence.trajectory_faults import without_copied_frames
from kinertia.findings.quantity import Where
from kinertia.io.lab_plates import ground_rotation
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers, Recording
from kinertia.trial.ground_contact import FootMarkers
from kinertia.trial.marker_quality import Travel, travel
from kinertia.trial.trial_input import Task

_FORE_AFT, _MEDIOLATERAL = "fore-aft", "mediolateral"


class AxisNames(TypedDict):
    """Names of a ground axis, as keyword arguments of `Where`."""

    axis: str
    file_axis: str


@dataclass(frozen=True)
class Axes:
    """Names of the ground axes X, Y (up) and Z of a recording.

    Attributes:
        vertical: the file's axis that is up, "+Z".
        fore_aft: ground axis along which the person moves or faces, 0 or 2.

    >>> Axes("+Z", 0).named(2)
    {'axis': 'mediolateral', 'file_axis': '-Y'}
    """

    vertical: str = "+Y"
    fore_aft: int = 0

    @classmethod
    def of(cls, vertical: str, moves: Travel) -> Self:
        """Name the axes of a recording: fore-aft is X unless the person walks along Z."""
        along_z = moves.kind == "walks" and abs(np.sin(np.radians(moves.direction_deg))) > np.sqrt(0.5)
        return cls(vertical, 2 if along_z else 0)

    def named(self, ground_axis: int) -> AxisNames:
        """Return the anatomical direction of ground axis 0, 1 or 2, and the signed axis of the file that it is."""
        across = _FORE_AFT if ground_axis == self.fore_aft else _MEDIOLATERAL
        direction = "vertical" if ground_axis == 1 else across
        row = ground_rotation(self.vertical)[ground_axis]
        index = int(np.argmax(np.abs(row)))
        return {"axis": direction, "file_axis": f"{'-' if row[index] < 0 else ''}{'XYZ'[index]}"}


@dataclass(frozen=True, eq=False)
class MarkerContext:
    """One recording, and what its markers show.

    Attributes:
        recording: in ground axes, SI units; its name is the trial's.
        marker_set: which label is which landmark, or the markers of an OpenSim model; None where none fits.
        static: the static trial that goes with it; None for the static trial itself, and without one.
        is_static: it is given as the static trial, or the only one in which the person stands.
        without_forces: only its markers are used.
        forces_refused: because its forces cannot be.
        stated_task: what the person does, if the user states it.
        condition: under which the trial was recorded, if the user states it.
        window_s: the window that the user vouches for.
        height_m: stature, where it is known.
        mass_kg: stated mass, where it is known.
    """

    recording: Recording
    marker_set: MarkerSet | None = None
    static: "MarkerContext | None" = None
    is_static: bool = False
    window_s: tuple[float, float] | None = None
    height_m: float | None = None
    mass_kg: float | None = None
    without_forces: bool = False
    forces_refused: bool = False
    stated_task: Task | None = None
    condition: str = ""

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.recording.name

    @property
    def all_markers(self) -> Markers:
        """Every marker of the file."""
        return self.recording.markers

    @cached_property
    def markers(self) -> Markers:
        """Markers of the marker set; all markers where no set fits."""
        if self.marker_set is None:
            return self.recording.markers
        present = set(self.recording.markers.labels)
        return self.recording.markers.select([label for label in self.marker_set.labels if label in present])

    @cached_property
    def seen_labels(self) -> frozenset[str]:
        """Labels of all markers that are visible in at least one frame."""
        markers = self.all_markers
        return frozenset(label for label, seen in zip(markers.labels, markers.seen.T, strict=True) if seen.any())

    @cached_property
    def travel(self) -> Travel:
        """Movement of the person: walking, standing still, or moving on the spot."""
        return travel(self.markers)

    @cached_property
    def axes(self) -> Axes:
        """Names of the ground axes of this recording."""
        return Axes.of(self.recording.vertical, self.travel)

    @cached_property
    def landmark_positions(self) -> Mapping[str, FloatArray]:
        """Positions (n, 3) m of every landmark whose labels are all present."""
        return {} if self.marker_set is None else landmark_positions(self.all_markers, self.marker_set)

    @cached_property
    def headings(self) -> Mapping[str, FloatArray]:
        """Headings of the feet and the pelvis, unit vectors (n, 3)."""
        return headings(self.landmark_positions)

    @cached_property
    def most_forwards(self) -> float:
        """Largest cosine between these headings and the direction of travel; 0 where the person does not travel."""
        return most_forwards(self.all_markers, self.headings)

    @property
    def walks_backwards(self) -> bool:
        """Whether the person travels opposite to the headings of feet and pelvis."""
        return self.most_forwards < -CLEAR

    @cached_property
    def feet(self) -> FootMarkers | None:
        """Labels of the markers on each foot, "r" and "l"; None unless both feet have one."""
        if self.marker_set is None:
            return None
        present = set(self.recording.markers.labels)
        feet = {
            side: [label for label in labels if label in present]
            for side, labels in self.marker_set.foot_labels().items()
        }
        return feet if all(feet.values()) else None

    @cached_property
    def segment_of_label(self) -> Mapping[str, str]:
        """Segment of each label of the marker set."""
        if self.marker_set is None:
            return {}
        return {label: name for name, labels in self.marker_set.segments.items() for label in labels}

    @cached_property
    def foot_trajectories(self) -> tuple[FootTrajectory, FootTrajectory] | None:
        """Trajectories of the right and the left foot; None where a foot is hardly visible."""
        if self.feet is None:
            return None
        # a foot that swings seems to stand in a frame that repeats the one before
        return foot_trajectories(without_copied_frames(self.all_markers), self.feet, self.recording.belt)

    def at(self, **where: Any) -> Where:
        """Return a place in this recording: `at(plate="plate 1", **self.along(2))`."""
        return Where(trial=self.name, **where)

    def along(self, ground_axis: int) -> AxisNames:
        """Return the names of ground axis 0, 1 or 2, as keyword arguments of `at`."""
        return self.axes.named(ground_axis)
