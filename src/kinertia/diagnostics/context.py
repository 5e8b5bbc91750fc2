"""Holds one recording, and one person with all recordings, for their checks; computes evidence once."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from kinertia.diagnostics.evidence.ambiguous_loads import (
    LITTLE_BEYOND_M,
    FootPoints,
    Overhang,
    SharedLoad,
    overhangs,
    shared_loads,
    shows_whole_feet,
    stray_contacts,
    without_legs,
    without_loads,
)
from kinertia.diagnostics.evidence.body_motion import ForceVelocity, VelocityChanges, force_velocities
from kinertia.diagnostics.evidence.foot_trajectories import periods, swing_in_turn
from kinertia.diagnostics.evidence.force_mass import (
    ForceMass,
    ForeignLoad,
    StandingMass,
    adult_share,
    force_mass,
    plate_masses,
    standing_mass,
)
from kinertia.diagnostics.evidence.landmarks import cosine, halluces
from kinertia.diagnostics.evidence.marker_precision import MarkerPrecision
from kinertia.diagnostics.evidence.plate_contacts import PlateContact, contact_span_s, contacts_of
from kinertia.diagnostics.evidence.trajectory_faults import FEWEST_FRAMES, TrajectoryFaults, without_copied_frames
from kinertia.diagnostics.marker_context import MarkerContext
from kinertia.errors import KinertiaError
from kinertia.estimation.prepared import TotalMass
from kinertia.findings.finding import Finding, Severity
from kinertia.model.imported_model import OsimModel
from kinertia.model.marker_set import MarkerSet
from kinertia.settings import Subject
from kinertia.trial.data import FEET, Markers, PlateLoads, Trial
from kinertia.trial.plate_assignment import build_trial
from kinertia.trial.sampled_data import within

_STRAIGHT = 0.87
"""Cosine of 30 degrees: in 33 walks and runs the pelvis turns by up to 20 degrees, in turns of children by 68 to 91."""
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class RecordingContext(MarkerContext):
    """One recording, for its checks, with its loads; attributes as in `MarkerContext`."""

    @property
    def recorded_plates(self) -> PlateLoads | None:
        """Force plates as recorded, if there are any and they are used."""
        return None if self.without_forces else self.recording.plates

    @cached_property
    def plates(self) -> PlateLoads | None:
        """Force plates without loads that are under no foot."""
        plates = self.recorded_plates
        return None if plates is None else without_loads(plates, self.stray_contacts, self.contacts)

    @cached_property
    def contact_span_s(self) -> tuple[float, float] | None:
        """First and last time (s) of the part used, around the loads on plates; None where all of it counts."""
        if self.is_static or self.plates is None:
            return None
        span = contact_span_s(self.plates)
        if span is None or self.window_s is None:
            return span
        return min(span[0], self.window_s[0]), max(span[1], self.window_s[1])

    def uses(self, span_s: tuple[float, float]) -> bool:
        """Return whether a span (s) is not wholly outside the window that the user states."""
        return self.window_s is None or (span_s[0] <= self.window_s[1] and self.window_s[0] <= span_s[1])

    @cached_property
    def measured_markers(self) -> Markers:
        """`markers` within the part used, without copies of dropped frames."""
        if self.is_static:
            return self.markers
        markers = without_copied_frames(self.markers)
        part = markers if self.contact_span_s is None else markers.cut(*self.contact_span_s)
        return part if len(part.time) >= FEWEST_FRAMES else markers

    @cached_property
    def marker_precision(self) -> MarkerPrecision:
        """Quantisation step and noise of the marker coordinates."""
        return MarkerPrecision.of(self.measured_markers)

    @cached_property
    def trajectory_faults(self) -> TrajectoryFaults:
        """Spikes, jumps and filled gaps of single markers; of a person who stands still, repeated spikes only."""
        segments = {} if self.marker_set is None else self.marker_set.segments
        coarse = self.is_static or self.marker_precision.rounded or self.marker_precision.noisy
        return TrajectoryFaults.of(self.measured_markers, segments, coarse)

    @cached_property
    def _all_contacts(self) -> Sequence[PlateContact]:
        plates, feet = self.recorded_plates, self.foot_trajectories
        return () if plates is None or feet is None else contacts_of(plates, feet)

    @cached_property
    def stray_contacts(self) -> Sequence[PlateContact]:
        """Loads under no foot, of another person or a thing; none where the person stands."""
        if self.is_static or self.recorded_plates is None or self.foot_trajectories is None:
            return ()
        return stray_contacts(self._all_contacts, self.foot_trajectories)

    @cached_property
    def contacts(self) -> Sequence[PlateContact]:
        """Every other load on a plate, with its position relative to the feet; none without plates or feet."""
        strays = set(map(id, self.stray_contacts))
        return [contact for contact in self._all_contacts if id(contact) not in strays]

    @cached_property
    def shows_whole_feet(self) -> bool:
        """Whether heel and forefoot of both feet are visible."""
        return shows_whole_feet(self.foot_trajectories, self.marker_set, self.seen_labels)

    @cached_property
    def shared_loads(self) -> Sequence[SharedLoad]:
        """Loads that both feet bear on one plate for a while."""
        feet, known = self.foot_trajectories, self.shows_whole_feet and not self.walks_backwards
        return [*shared_loads(self.contacts, feet, self.marker_set)] if feet is not None and known else []

    @cached_property
    def overhangs(self) -> Sequence[Overhang]:
        """Feet that extend beyond the edge of the plate that they stand on; none where its corners are unknown."""
        if self.plates is None or self.feet is None:
            return ()
        named = {} if self.marker_set is None else self.marker_set.landmarks
        toes = {label for side in FEET for label in named.get(f"toe_{side}", ())}
        tips, markers = halluces(self.landmark_positions, self.height_m), self.all_markers
        feet = [FootPoints.of(markers, self.feet[side], toes, tips.get(side)) for side in FEET]
        return overhangs(self.plates, self.contacts, markers.time, feet)

    @cached_property
    def whole_contacts(self) -> Sequence[PlateContact]:
        """`contacts` of feet whose whole load is on their plate, with little of the foot beyond its edge."""
        far = [reach for reach in self.overhangs if reach.overhang_m > LITTLE_BEYOND_M]
        return [
            contact
            for contact in self.contacts
            if not any(
                (other.plate, other.foot) == (contact.plate, contact.foot)
                and contact.time[0] <= other.span_s[1]
                and other.span_s[0] <= contact.time[-1]
                for other in far
            )
        ]

    @property
    def whole_loads(self) -> PlateLoads | None:
        """The plates without the loads that are not among `whole_contacts`."""
        plates, whole = self.plates, set(map(id, self.whole_contacts))
        partly = [contact for contact in self.contacts if id(contact) not in whole]
        return None if plates is None else without_loads(plates, partly, self.whole_contacts)

    @cached_property
    def loaded(self) -> Trial | KinertiaError | None:
        """The trial with its loads sorted by foot, the error where that is impossible, None without plates or feet."""
        if self.plates is None or self.feet is None:
            return None
        try:
            return build_trial(replace(self.recording, plates=self.plates), self.feet, self.window_s)
        except KinertiaError as error:
            return error

    @property
    def trial(self) -> Trial | None:
        """The trial with its loads sorted by foot, in the laboratory's axes; None where that is impossible."""
        return self.loaded if isinstance(self.loaded, Trial) else None

    @cached_property
    def has_strides(self) -> bool:
        """Whether the person walks or runs over the plates; true where the feet are not known well enough to decide.

        Landings, squats and standing have none: the pelvis then does not move with the body, nor the load from
        heel to toe.
        """
        if self.trial is not None and any(periods(self.trial.loads)):
            return True
        feet = self.foot_trajectories
        if feet is None:
            return self.trial is None
        return swing_in_turn(feet, self.contact_span_s or (float(feet[0].time[0]), float(feet[0].time[-1])))

    @cached_property
    def turns(self) -> bool:
        """Whether the person turns: the pelvis heads elsewhere after the loads on plates than before them."""
        facing, time = self.headings.get("pelvis"), self.all_markers.time
        if facing is None or self.contact_span_s is None:
            return False
        seen = within(time, *self.contact_span_s) & np.isfinite(facing).all(axis=1)
        if not seen.any():
            return False
        first, last = facing[seen][[0, -1]]
        return cosine(first[None], last[None]) < _STRAIGHT

    @cached_property
    def trial_on_plates(self) -> Trial | None:
        """The trial without frames in which a foot bears load beyond its plate, or both feet or another person share
        one, unless the user vouches for a window; None where it is impossible, or hardly any frames are left.
        """
        beyond = [(reach.unmeasured_s, reach.foot) for reach in self.overhangs if reach.unmeasured_s is not None]
        foreign = [
            ((foreign_contact.time[0], foreign_contact.time[-1]), foreign_contact.foot)
            for foreign_contact in self.foreign_contacts
        ]
        return self._without(
            [*beyond, *foreign, *((shared_load.unknown_s, slice(None)) for shared_load in self.shared_loads)]
        )

    def _without(self, spans: Iterable[tuple[tuple[float, float], int | slice]]) -> Trial | None:
        trial = self.trial
        return trial if trial is None or self.window_s is not None else without_legs(trial, spans)

    @cached_property
    def foreign_load(self) -> ForeignLoad | None:
        """A temporary load on the plates besides the person; None without one, or if no mass is stated."""
        if self.mass_kg is None or self.is_static or self._mass_on_plates is None:
            return None
        return self._mass_on_plates.foreign(self.mass_kg)

    @cached_property
    def _mass_on_plates(self) -> ForceMass | None:
        """Mass on the plates, which need not be the body alone."""
        return self._weighed(self.trial)

    def _weighed(self, trial: Trial | None) -> ForceMass | None:
        if trial is None:
            return None
        return force_mass(self.segment_of_label, trial, self.travel.kind == "stands still")

    @cached_property
    def foreign_contacts(self) -> Sequence[PlateContact]:
        """Loads on the plate that bears most while there is a foreign load."""
        if self.foreign_load is None or self.plates is None:
            return ()
        start_s, end_s = self.foreign_load.span_s
        most = int(np.argmax(self.plates.force[within(self.plates.time, start_s, end_s), :, 1].mean(axis=0)))
        on_most_used = [contact for contact in self.contacts if contact.plate == most]
        return [contact for contact in on_most_used if contact.time[0] <= end_s and contact.time[-1] >= start_s]

    @cached_property
    def adult_share(self) -> float:
        """Body weight as a share of an adult's, at most 1; limits in newtons are those of adults times this share."""
        return adult_share(self.plates, self.mass_kg)

    @cached_property
    def velocities(self) -> Sequence[ForceVelocity]:
        """Body velocity from the markers and from the forces, one entry per measured window."""
        return () if self.trial is None else force_velocities(self.trial, self.segment_of_label)

    @cached_property
    def velocity_changes(self) -> VelocityChanges | None:
        """Body velocities of all windows together, each without its linear trend; None where there are no windows."""
        return VelocityChanges.of(self.velocities) if self.velocities else None

    @cached_property
    def velocity_changes_on_plates(self) -> VelocityChanges | None:
        """`velocity_changes` of the frames of `trial_on_plates` alone."""
        trial = self.trial_on_plates
        if not (self.overhangs or self.foreign_contacts):
            return self.velocity_changes
        parts = () if trial is None else force_velocities(trial, self.segment_of_label)
        return VelocityChanges.of(parts) if parts else None

    @cached_property
    def force_mass(self) -> ForceMass | None:
        """Body mass from the vertical force; None where forces or markers do not show it."""
        trial = self.trial_on_plates
        return self._mass_on_plates if trial is self.trial else self._weighed(trial)

    @cached_property
    def standing_mass(self) -> StandingMass | None:
        """Body mass while the person stands still with both feet on plates; None where the person does not."""
        if self.plates is None or self.feet is None:
            return None
        return standing_mass(self.plates, self.all_markers, self.feet)

    @cached_property
    def plate_masses(self) -> Mapping[str, float]:
        """Body mass (kg) from each plate that supports all of it for a while; empty if loads are not sorted by foot."""
        trial = self._without((load.unknown_s, slice(None)) for load in self.shared_loads)
        if self.plates is None or trial is None:
            return {}
        return plate_masses(self.plates, trial, self.all_markers, self.segment_of_label)

    @property
    def plates_reached_beyond(self) -> frozenset[str]:
        """Names of plates that a foot exceeds so far that part of its load is elsewhere."""
        names = () if self.plates is None else self.plates.names
        return frozenset(names[overhang.plate] for overhang in self.overhangs if overhang.overhang_m > LITTLE_BEYOND_M)

    @property
    def whole_plate_masses(self) -> Mapping[str, float]:
        """`plate_masses` of plates that bear all of the person and no one else."""
        names = () if self.plates is None else self.plates.names
        doubtful = self.plates_reached_beyond | {names[foreign.plate] for foreign in self.foreign_contacts}
        return {name: kg for name, kg in self.plate_masses.items() if name not in doubtful}


@dataclass(frozen=True, eq=False)
class PersonContext:
    """One person with all recordings.

    Attributes:
        subject: as stated, with what files add.
        trials: recordings of motions.
        static: the static trial; None with an OpenSim model, or without one.
        marker_set: which label is which landmark, or the markers of the model.
        model: the OpenSim model, where there is one.
        calibrated: whether markers and joints of the model are to be calibrated.
        total_mass: stated masses of the body and of attached items; None where no mass is known.
        found: findings of the recordings themselves, where a question depends on them.
        more_statics: recordings in which the person stands, of which none is the static trial.
        files_only: whether single files are checked, besides which there may be others.
    """

    subject: Subject
    trials: Sequence[RecordingContext]
    static: RecordingContext | None = None
    marker_set: MarkerSet | None = None
    model: OsimModel | None = None
    calibrated: bool = False
    total_mass: TotalMass | None = None
    found: Sequence[Finding] = field(default=())
    more_statics: Sequence[RecordingContext] = ()
    files_only: bool = False

    @property
    def standing(self) -> Sequence[RecordingContext]:
        """The static trial, or every recording that may be it."""
        return self.more_statics if self.static is None else (self.static, *self.more_statics)

    @property
    def has_trials(self) -> bool:
        """Whether trials were given, blocked ones included, so that the model is not checked on its own."""
        return bool(self.trials or self.found)

    def has_error(self, trial: str, *codes: str) -> bool:
        """Return whether an ERROR of one of these codes, questions or families was found in a trial."""
        return any(
            finding.severity is Severity.ERROR and finding.where.trial == trial and finding.code.startswith(codes)
            for finding in self.found
        )


def odd_ones(first: T, other: T, witnesses: Iterable[tuple[float, float]]) -> tuple[T, ...]:
    """Return the one that most other recordings are farther from; both if there are none, or on a tie.

    Args:
        first, other: the two that disagree.
        witnesses: distances of every further recording from the first and from the other.

    >>> odd_ones("walk 1", "walk 2", [(0.001, 0.02), (0.002, 0.015)])
    ('walk 2',)
    >>> odd_ones("walk 1", "walk 2", [])
    ('walk 1', 'walk 2')
    """
    votes = sum((to_first > to_other) - (to_first < to_other) for to_first, to_other in witnesses)
    return (first, other) if votes == 0 else (first,) if votes > 0 else (other,)
