"""Is ground contact complete, and the participant's alone? Who stands where and when, and is all of stance known?"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.evidence.ambiguous_loads import (
    HALLUX_M,
    NO_FOOT_M,
    OTHERS_SHARE,
    OUTSIDE_M,
    OVERHANG_M,
    STRAY_M,
    off_plate,
)
from kinertia.diagnostics.evidence.body_motion import LEAST_WINDOW_S
from kinertia.diagnostics.evidence.force_mass import FOREIGN_S, FOREIGN_SHARE, MOSTLY
from kinertia.diagnostics.runner import NEEDS_LOADS_UNDER_FEET, check
from kinertia.diagnostics.subject.movements import task_of
from kinertia.errors import KinertiaError
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.motion.common_cutoff import LOWEST_HZ
from kinertia.motion.kinematics import END_PERIODS, FEWEST_FRAMES, legs_on_plates
from kinertia.trial.data import FEET, BoolArray, FloatArray, Recording
from kinertia.trial.ground_contact import FootMarkers, bridged
from kinertia.trial.plate_assignment import FOOT_NAMES, SHORTEST_CONTACT_S, assign_plates, no_forces
from kinertia.trial.sampled_data import runs, within
from kinertia.trial.stances import (
    LOADING_END,
    MID_STANCE_END,
    OF_PHASE,
    LegCoverage,
    joined_coverage,
    leg_coverage,
    listed,
)
from kinertia.trial.trial_input import GAIT, Task

_COMPARED_S = Limit(LEAST_WINDOW_S, "s")
_FOOT_NAMES = {"r": "right", "l": "left", None: "unknown foot"}
_LISTED = 4


@check(
    "F191",
    "P271",
    "P273",
    "P274",
    "P275",
    "P277",
    "P278",
    "P279",
    "P280",
    "P283",
    "P286",
    "P290",
    "T104",
    frames=Limit(FEWEST_FRAMES),
    shortest=Limit(SHORTEST_CONTACT_S, "s"),
)
def complete_contact(context: RecordingContext) -> Iterator[Finding]:
    """Report T104, P271, P278: no trial can be made of the recording; P279: it has too few frames with complete
    contact; P290: it has these of single legs only; P273, P274, P275, P277: how its loads were sorted by foot; P280,
    P283: only its markers are used, as requested or because its forces are unusable; F191, T104: hardly any frames are
    in the window stated for these, or in the trial.
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
    windows = context.trial.windows()
    frames = len(context.trial.markers.cut(*windows[0]).time) if windows else 0
    if frames >= FEWEST_FRAMES:
        return
    legs = context.trial.known_legs[legs_on_plates(context.trial)]
    if len(legs) >= FEWEST_FRAMES:
        feet = [name for name, known in zip(FOOT_NAMES, legs.T, strict=True) if known.sum() >= FEWEST_FRAMES]
        yield finding("P290", context.at(), foot=Quantity(" and ".join(feet)), frames=Quantity(len(legs), "1"))
    else:
        measured = Quantity(frames, "1", limit=FEWEST_FRAMES)
        yield finding("P279", context.at(span_s=windows[0] if windows else None), frames=measured)


@check("P291", window=_COMPARED_S)
def compared_with_motion(person: PersonContext) -> Iterator[Finding]:
    """Report P291: contact is nowhere measured for long enough to compare forces with motion."""
    windows = [window for trial in person.trials if trial.trial is not None for window in trial.trial.windows()]
    longest_s = max((end - start for start, end in windows), default=np.inf)
    if longest_s < _COMPARED_S:
        yield finding("P291", Where(), window_s=Quantity(longest_s, "s", limit=_COMPARED_S))


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


@check("P276", unless=NEEDS_LOADS_UNDER_FEET, outside=OUTSIDE_M, share=OTHERS_SHARE)
def both_feet(context: RecordingContext) -> Iterator[Finding]:
    """Report P276: a load between the feet; both are on the plate, and only their total load is known."""
    plates = context.plates
    if plates is None or context.is_static:
        return
    for load in filter(lambda shared: context.uses(shared.span_s), context.shared_loads):
        where = context.at(plate=plates.names[load.contact.plate], span_s=load.span_s)
        yield finding("P276", where, share=Quantity(load.share, "1", limit=load.limit))


@check("P282", unless=NEEDS_LOADS_UNDER_FEET, overhang=OVERHANG_M, hallux=HALLUX_M, edge=NO_FOOT_M)
def plate_edges(context: RecordingContext) -> Iterator[Finding]:
    """Report P282: feet that extend beyond the plate that they stand on, onto the floor."""
    plates = context.plates
    if plates is None or context.is_static:
        return
    for overhang in filter(lambda reach: context.uses(reach.span_s), context.overhangs):
        yield finding(
            "P282",
            context.at(plate=plates.names[overhang.plate], span_s=overhang.span_s),
            overhang_m=Quantity(overhang.overhang_m, "m", limit=OVERHANG_M),
            foot=Quantity(FOOT_NAMES[overhang.foot]),
        )


@check("P284", unless=("P201", "P202", "P203", "P204"), share=FOREIGN_SHARE, lasts=FOREIGN_S, right=MOSTLY)
def foreign_load(context: RecordingContext) -> Iterator[Finding]:
    """Report P284: a foreign load; an ERROR if it leaves hardly any frames."""
    found = context.foreign_load
    if found is None:
        return
    names = () if context.plates is None else context.plates.names
    plates = {names[foreign.plate] for foreign in context.foreign_contacts}
    left = context.trial_on_plates is not None and bool(plates)
    where = context.at(plate=plates.pop() if plates else None, span_s=found.span_s)
    surplus = Quantity(found.surplus, "1", limit=FOREIGN_SHARE)
    yield finding("P284", where, None if left else Severity.ERROR, surplus=surplus)


@check("P285", far=STRAY_M)
def stray_loads(context: RecordingContext) -> Iterator[Finding]:
    """Report P285: loads that are under no foot and were left out."""
    names = () if context.plates is None else context.plates.names
    for stray in context.stray_contacts:
        where = context.at(plate=names[stray.plate], span_s=(float(stray.time[0]), float(stray.time[-1])))
        yield finding("P285", where, distance_m=Quantity(stray.distance_m, "m", limit=STRAY_M, usual=STRAY_M.usual))


def coverage_of(context: RecordingContext) -> tuple[LegCoverage, ...]:
    """Predict the part of stance and stride of each leg that will have joint moments; empty without strides."""
    trial = context.trial_on_plates or context.trial
    if trial is None or context.is_static or task_of(context) not in GAIT:
        return ()
    return leg_coverage(trial, trial.known_legs)


@check("P272", "P289", phase=OF_PHASE, loading=LOADING_END, middle=MID_STANCE_END)
def stance_coverage(context: PersonContext) -> Iterator[Finding]:
    """Report P272: a phase of a leg's stance is on plates in no trial of a task; P289: hardly anything of it is.

    Not where the user states the window of every trial.
    """
    by_task: dict[Task, list[RecordingContext]] = {}
    for trial in context.trials:
        by_task.setdefault(task_of(trial), []).append(trial)
    for task, trials in by_task.items():
        if all(trial.window_s is not None for trial in trials):
            continue
        for leg in joined_coverage(map(coverage_of, trials)):
            if leg.missing:
                yield _finding(task, trials, leg)


def _finding(task: Task, trials: Sequence[RecordingContext], leg: LegCoverage) -> Finding:
    where = Where(trial=trials[0].name if len(trials) == 1 else None, part=f"{leg.word} leg, {task}")
    evidence = {"side": Quantity(leg.word), "task": Quantity(task)}
    if not leg.none:
        evidence |= {"phase": Quantity(listed(leg.missing)), "known": Quantity(leg.ranges)}
    return with_evidence("P289" if leg.none else "P272", where, evidence)


@dataclass(frozen=True)
class Contact:
    """Contact of one foot (None where the markers do not show which) with one plate."""

    foot: str | None
    start_s: float
    end_s: float


@dataclass(frozen=True)
class PlateCheck:
    """Summary of one force plate: its peak and who stands on it when.

    Attributes:
        name: as the recording has it.
        peak_n: largest vertical force.
        contacts: in the order of time.
        outside_share: share of reliably loaded samples whose centre of pressure is off the plate; None where the file
            has no corners or nothing is loaded.
    """

    name: str
    peak_n: float
    contacts: tuple[Contact, ...]
    outside_share: float | None

    def stood_on(self) -> str:
        """Describe which foot was on the plate when; of many contacts, their number."""
        if not self.contacts:
            return "none"
        phrases = []
        for foot in dict.fromkeys(contact.foot for contact in self.contacts):
            spans = [(contact.start_s, contact.end_s) for contact in self.contacts if contact.foot == foot]
            listed = ", ".join(f"{start:.2f}-{end:.2f}" for start, end in spans)
            if len(spans) > _LISTED:
                listed = f"{len(spans)} contacts, {spans[0][0]:.2f}-{spans[-1][1]:.2f}"
            phrases.append(f"{_FOOT_NAMES[foot]} {listed} s")
        return "; ".join(phrases)


def check_plates(recording: Recording, feet: FootMarkers | None) -> tuple[PlateCheck, ...]:
    """Summarise every plate of a recording; without foot markers the contacts have no foot."""
    if recording.plates is None:
        return ()
    return tuple(_check_plate(recording, p, feet) for p in range(len(recording.plates.names)))


def _check_plate(recording: Recording, p: int, feet: FootMarkers | None) -> PlateCheck:
    plates = recording.plates
    assert plates is not None
    vertical = plates.force[:, p, 1]
    if feet is None:
        contacts = _contacts(plates.time, vertical > 0, None)
    else:
        alone = replace(
            plates,
            names=plates.names[p : p + 1],
            force=plates.force[:, p : p + 1],
            moment=plates.moment[:, p : p + 1],
            declared_feet=plates.declared_feet[p : p + 1],
            corners=None,
        )
        loads = assign_plates(replace(recording, plates=alone), feet)[0]
        contacts = [
            contact
            for foot, name in enumerate(FEET)
            for contact in _contacts(loads.time, loads.force[:, foot, 1] > 0, name)
        ]
    share, _ = off_plate(plates, p) or (None, 0.0)
    ordered = tuple(sorted(contacts, key=lambda contact: contact.start_s))
    return PlateCheck(plates.names[p], float(vertical.max()), ordered, share)


def _contacts(time: FloatArray, loaded: BoolArray, foot: str | None) -> list[Contact]:
    spans = [(float(time[first]), float(time[last])) for first, last in runs(bridged(time, loaded))]
    return [Contact(foot, start, end) for start, end in spans if end - start >= SHORTEST_CONTACT_S]
