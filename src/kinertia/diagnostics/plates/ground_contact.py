"""Is ground contact complete? Covers loads sorted by foot, frames with complete contact, and feet beside plates or both
on one."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import BETWEEN_M, ONE_STEP_S, PlateContact
from kinertia.diagnostics.evidence.plate_edges import OVERHANG_M
from kinertia.diagnostics.plates.heel_landing import goes_forwards
from kinertia.errors import KinertiaError
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.motion.common_cutoff import LOWEST_HZ
from kinertia.motion.kinematics import END_PERIODS, FEWEST_FRAMES
from kinertia.trial.data import FEET, BoolArray
from kinertia.trial.plate_assignment import FOOT_NAMES, no_forces
from kinertia.trial.sampled_time import span_s, within

_OUTSIDE_M, _OUTSIDE_SHARE = 0.14, 0.01
_MOSTLY = 0.5
_OTHERS_SHARE = 0.25
"""The centre of pressure divides the line between both feet as they share the load. At foot off of feet without a toe
marker it is up to 0.19 of the way to the other foot, which stands on the floor."""


def complete_contact(context: RecordingContext) -> Iterator[Finding]:
    """Report T104, P271, P278: no trial can be made of the recording; P279: it has too few frames with complete
    contact; P273, P274, P275, P277: how its loads were sorted by foot; P280, P283: only its markers are used, as
    requested or because its forces are unusable; F191, T104: hardly any frames are in the window stated for these, or
    in the trial.
    """
    if context.is_static:
        return
    if context.without_forces:
        use = finding("P283" if context.forces_refused else "P280", context.at())
        yield _too_few_in_window(context) or _too_few_frames(context) or use
        return
    if context.plates is None:
        yield no_forces(context.recording).in_trial(context.name)
        return
    if isinstance(context.loaded, KinertiaError):
        if context.loaded.finding is not None:
            yield context.loaded.finding
        return
    if context.trial is None:
        return
    yield from context.trial.findings
    start, end = context.trial.windows()[0]
    frames = len(context.trial.markers.cut(start, end).time)
    if frames < FEWEST_FRAMES:
        measured = Quantity(frames, "1", limit=FEWEST_FRAMES)
        yield finding("P279", context.at(span_s=(start, end)), frames=measured)


def _too_few_in_window(context: RecordingContext) -> Finding | None:
    """Return F191 if a window stated for a trial without forces has too few of its frames."""
    time, window_s = context.recording.markers.time, context.window_s
    if window_s is None or (frames := int(within(time, *window_s).sum())) >= FEWEST_FRAMES:
        return None
    stated = f"[{window_s[0]:g}, {window_s[1]:g}]"
    lasts = f"the trial lasts from {time[0]:.2f} to {time[-1]:.2f} s"
    evidence = {
        "entry": Quantity(f"window_s = {stated}"),
        "expected": Quantity(f"has {frames} frames of the trial, and {FEWEST_FRAMES} are needed; {lasts}"),
        "key": Quantity("window_s"),
        "value": Quantity(stated),
    }
    return with_evidence("F191", context.at(), evidence)


def _too_few_frames(context: RecordingContext) -> Finding | None:
    """Return T104 if a trial without forces is too short for its motion to be used, at the lowest cutoff."""
    markers = context.recording.markers
    frames, fewest = len(markers.time), FEWEST_FRAMES + 2.0 * END_PERIODS * markers.rate_hz / LOWEST_HZ
    return None if frames >= fewest else finding("T104", context.at(), frames=Quantity(frames, "1", limit=fewest))


def both_feet(context: RecordingContext) -> Iterator[Finding]:
    """Report P276: a load between the feet; both are on the plate, and only their total load is known. A foot that
    swings by its markers is on none.
    """
    plates, feet = context.plates, context.foot_trajectories
    if plates is None or feet is None or context.is_static or not goes_forwards(context):
        return
    for contact in context.contacts:
        away = _under_both(_to_toes(context, contact, feet)) & feet[1 - contact.foot].standing(contact.time)
        share = float(contact.weight[away].sum() / contact.weight.sum())
        limit = _MOSTLY if span_s(contact.time) > ONE_STEP_S else _OUTSIDE_SHARE
        if share > limit:
            when = contact.time[away]
            span = (float(when[0]), float(when[-1]))
            where = context.at(plate=plates.names[contact.plate], span_s=span)
            yield finding("P276", where, share=Quantity(share, "1", limit=limit))


def _to_toes(
    context: RecordingContext, contact: PlateContact, feet: tuple[FootTrajectory, FootTrajectory]
) -> PlateContact:
    """Return the load with its distance to the end of the toes, for feet that have no marker there."""
    named = {} if context.marker_set is None else context.marker_set.landmarks
    whole = [foot if f"toe_{side}" in named else foot.with_toes() for side, foot in zip(FEET, feet, strict=True)]
    return replace(contact, offset_m=np.stack([foot.offset_m(contact.time, contact.place) for foot in whole]))


def _under_both(contact: PlateContact) -> BoolArray:
    """Return (k,) where the load is between the feet, or away from its own foot while the other bears a good part of
    it."""
    own, other = np.linalg.norm(contact.offset_m, axis=2)[[contact.foot, 1 - contact.foot]]
    opposite = np.prod(contact.offset_m, axis=0).sum(axis=1) < 0
    away: BoolArray = np.minimum(own, other) > BETWEEN_M
    away &= opposite
    # on a treadmill's single belt the feet come in turn, and each sample is sorted (`plate_assignment`)
    if span_s(contact.time) <= ONE_STEP_S:
        away |= own > _OUTSIDE_M
    away &= own > _OTHERS_SHARE * (own + other)
    return away


def plate_edges(context: RecordingContext) -> Iterator[Finding]:
    """Report P282: feet that extend beyond the plate that they stand on, onto the floor."""
    plates = context.plates
    if plates is None or context.is_static:
        return
    for one in context.overhangs:
        yield finding(
            "P282",
            context.at(plate=plates.names[one.plate], span_s=one.span_s),
            overhang_m=Quantity(one.overhang_m, "m", limit=OVERHANG_M),
            foot=Quantity(FOOT_NAMES[one.foot]),
        )
