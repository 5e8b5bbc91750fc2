"""What speaks against measurements before anything is computed from them: one list for `check` and for every fit.

Each detector looks where a mistake shows first; of two that could see the same one, the likelier cause comes first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from kinertia.diagnostics.evidence.caused_velocity import caused_velocities
from kinertia.diagnostics.evidence.foot_ways import belt_doubts
from kinertia.diagnostics.evidence.segment_distances import SegmentDistances
from kinertia.diagnostics.labels.body_sides import sides_trouble, walks_backwards
from kinertia.diagnostics.labels.torn_segments import torn_segments_trouble
from kinertia.diagnostics.markers.computed_markers import computed_doubts
from kinertia.diagnostics.markers.marker_faults import (
    exchanged_trouble,
    jump_doubts,
    lost_frames_trouble,
    spikes_trouble,
    straight_doubts,
)
from kinertia.diagnostics.markers.marker_resolution import made_up_frames_trouble, noisy_doubts, rounded_trouble
from kinertia.diagnostics.markers.over_smoothed import over_smoothed_trouble
from kinertia.diagnostics.markers.walkway_slope import walkway_slope_doubts
from kinertia.diagnostics.model.model_on_person import model_on_person_doubts, model_on_person_trouble
from kinertia.diagnostics.plates.force_faults import direction_trouble, offset_trouble
from kinertia.diagnostics.plates.load_places import LoadPlaces
from kinertia.diagnostics.plates.mains_hum import hum_doubts, hum_trouble
from kinertia.diagnostics.plates.one_plate import axis_gain_trouble, plate_offset_trouble, plate_sign_trouble
from kinertia.diagnostics.plates.plate_faults import loads_doubts, loads_trouble
from kinertia.diagnostics.plates.plate_gains import gain_doubts
from kinertia.diagnostics.plates.torque_point import torque_point_doubts
from kinertia.diagnostics.subject.camera_scale import trial_scales
from kinertia.diagnostics.subject.same_body import body_trouble, session_doubts
from kinertia.diagnostics.subject.stature import flat_feet_doubts, floor_doubts, stature_doubts
from kinertia.diagnostics.timing.force_rate import rate_doubts
from kinertia.errors import TrialError
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers, Recording, Trial
from kinertia.trial.exchanged_torques import exchanged_torques_doubts
from kinertia.trial.force_resolution import ringing_doubts
from kinertia.trial.marker_quality import axes_trouble, extent_m, travel
from kinertia.trial.torque_columns import torque_columns_doubts


class Doubt(NamedTuple):
    """One thing that speaks against a recording: what, with its evidence and what to do, and whether a fit refuses."""

    sentence: str
    refused: bool


def static_doubts(static: Recording, marker_set: MarkerSet | None, height_m: float | None = None) -> list[Doubt]:
    """What speaks against a static trial by itself.

    Args:
        static: the person standing.
        marker_set: which label is which landmark; None with an OpenSim model.
        height_m: as stated, where it is known.
    """
    own = _worn(static.markers, marker_set)
    doubts = _refused(axes_trouble(extent_m(own)) or spikes_trouble(own) or _sides(static.markers, marker_set))
    if doubts or marker_set is None or not marker_set.landmarks:
        return doubts
    if (moves := travel(own)).kind == "walks":
        return _told([_walked(moves.distance_m)])
    stature = [] if height_m is None else stature_doubts(static, marker_set, height_m)
    feet = floor_doubts(static.markers, marker_set) or flat_feet_doubts(static.markers, marker_set)
    return _told([*feet, *stature])


def trial_doubts(
    recording: Recording,
    marker_set: MarkerSet | None,
    static: Recording | None,
    feet: Mapping[str, Sequence[str]] | None,
) -> list[Doubt]:
    """What speaks against the recording of a motion, before its loads are sorted by foot.

    Args:
        recording: with or without plates.
        marker_set: which label is which landmark; None with an OpenSim model.
        static: the static trial that goes with it, if there is one.
        feet: labels of the markers on each foot; None where they are not known.
    """
    markers = recording.markers
    if len(markers.time) < 2:
        return _refused("a single frame shows no motion: export the whole trial, or leave it out")
    own = _worn(markers, marker_set)
    trouble = (
        axes_trouble(extent_m(own))
        or made_up_frames_trouble(own)
        or spikes_trouble(own)
        or _sides(markers, marker_set)
        or lost_frames_trouble(own)
        or exchanged_trouble(own)
    )
    session: list[str] = []
    # labels that are swapped in the static trial are named with it, and put its distances wrong
    if not trouble and static is not None and marker_set is not None and not _sides(static.markers, marker_set):
        distances = SegmentDistances.of(static.markers, markers, marker_set)
        trouble = body_trouble(distances)
        session = [] if trouble else session_doubts(distances)
    if not trouble and marker_set is not None and marker_set.in_model is not None:
        trouble = model_on_person_trouble(marker_set.in_model, own, marker_set)
        session = [] if trouble else model_on_person_doubts(marker_set.in_model, own, marker_set)
    smeared = [] if recording.plates is None else ringing_doubts(recording.plates)
    places = None
    if not trouble and recording.plates is not None:
        trouble = loads_trouble(recording.plates) or hum_trouble(recording.plates)
        places = None if trouble or feet is None else LoadPlaces.of(recording, feet)
        if places is not None and (trouble := places.trouble()):
            # loads that are smeared last too long, and those with wrong torques act elsewhere
            trouble = "; ".join([*smeared, *torque_columns_doubts(recording.plates), trouble])
    if trouble:
        return _refused(trouble)
    ways = _ways_doubts(own, marker_set)
    if not ways and marker_set is not None and (torn := torn_segments_trouble(own, marker_set)):
        return _refused(torn)
    computed = [] if marker_set is None else computed_doubts(own, marker_set)
    sentences = [*ways, *computed, *session, *smeared]
    if recording.belt is None and feet is not None:
        sentences += walkway_slope_doubts(markers, feet)
    if recording.belt is not None and feet is not None:
        sentences += belt_doubts(markers, feet, recording.belt)
    if recording.plates is not None:
        sentences += [*hum_doubts(recording.plates), *loads_doubts(recording.plates)]
        sentences += exchanged_torques_doubts(recording.plates)
        sentences += torque_columns_doubts(recording.plates) or torque_point_doubts(recording.plates)
        # what is usual of loads under feet is of people who land on the heel
        backwards = marker_set is not None and walks_backwards(markers, marker_set)
        if places is not None and not backwards and _shows_whole_feet(markers, marker_set):
            sentences += places.doubts()
    return _told(sentences)


def motion_doubts(recording: Recording, trial: Trial, marker_set: MarkerSet) -> list[Doubt]:
    """What speaks against loads that were sorted by foot: whether they move the body as the markers show.

    Args:
        recording: as read.
        trial: what became of it, in the laboratory's axes.
        marker_set: which marker is on which segment.
    """
    owners = {label: name for name, labels in marker_set.segments.items() for label in labels}
    plates, parts = recording.plates, caused_velocities(trial, owners)
    trouble = over_smoothed_trouble(trial, owners, parts)
    if not trouble and plates is not None:
        trouble = plate_sign_trouble(plates, parts)
    if trouble := trouble or direction_trouble(trial, parts):
        return _refused(trouble)
    along = [] if plates is None else [axis_gain_trouble(plates, parts), plate_offset_trouble(plates, parts)]
    along = [one for one in along if one] or [offset_trouble(parts)]
    sentences = [*filter(None, along), *gain_doubts(recording, trial, owners, parts)]
    return _told([*rate_doubts(trial, parts), *sentences])


def uneven_scales(trials: Sequence[Trial], marker_set: MarkerSet) -> list[str]:
    """Warnings for a fit of trials of one person that were recorded with different scales of the cameras."""
    return [f"{name}: {said}" for name, said in trial_scales([(one.name, one.markers) for one in trials], marker_set)]


def warnings_of(name: str, doubts: Sequence[Doubt]) -> list[str]:
    """Warnings for a fit of the recording of this name.

    Raises:
        TrialError: one of the doubts is refused.
    """
    for one in doubts:
        if one.refused:
            raise TrialError(name, one.sentence)
    return [f"{name}: {one.sentence}" for one in doubts]


def _ways_doubts(own: Markers, marker_set: MarkerSet | None) -> list[str]:
    """What speaks against the ways of single markers; where all are rounded or noisy, they only seem to."""
    if rounded := rounded_trouble(own):
        return [rounded]
    if noisy := noisy_doubts(own):
        return noisy
    # a stretch that was written by a computer often ends with a jump
    return [*straight_doubts(own, dict(marker_set.segments) if marker_set else {}), *jump_doubts(own)]


def _walked(distance_m: float) -> str:
    return (
        f"the person walks in the static trial, by {distance_m:.1f} m: the file of a motion was given in its place; "
        "joint centres and the axes of the feet, which should stand flat on the floor, are wrong by that: give the "
        "trial in which the person stands"
    )


def _worn(markers: Markers, marker_set: MarkerSet | None) -> Markers:
    if marker_set is None:
        return markers
    return markers.select([label for label in marker_set.labels if label in markers.labels])


def _shows_whole_feet(markers: Markers, marker_set: MarkerSet | None) -> bool:
    """Whether heel and forefoot of both feet are seen: between other markers is no place to expect a load."""
    if marker_set is None or not marker_set.landmarks:
        return True
    shown = {label for label, seen in zip(markers.labels, markers.seen.T, strict=True) if seen.any()}
    ends = [
        [marker_set.landmarks[f"{name}_{side}"] for name in names if f"{name}_{side}" in marker_set.landmarks]
        for side in "rl"
        for names in (("heel",), ("metatarsal", "toe"))
    ]
    return all(any(shown & set(labels) for labels in end) for end in ends if end)


def _sides(markers: Markers, marker_set: MarkerSet | None) -> str:
    return "" if marker_set is None else sides_trouble(markers, marker_set)


def _refused(trouble: str) -> list[Doubt]:
    return [Doubt(trouble, True)] if trouble else []


def _told(sentences: Sequence[str]) -> list[Doubt]:
    return [Doubt(sentence, False) for sentence in sentences]
