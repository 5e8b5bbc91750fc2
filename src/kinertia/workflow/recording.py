"""Is a recording fit for a fit? What its files hold, and verdicts in words, before any model is built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.doubts import Doubt, motion_doubts, static_doubts, trial_doubts
from kinertia.diagnostics.evidence.free_moment import mean_turning
from kinertia.diagnostics.labels.marker_set_match import MarkerSetMatch, judged_labels, match_labels
from kinertia.diagnostics.plates.plate_summary import ForceMass, PlateCheck, check_plates, mass_by_strides
from kinertia.diagnostics.result.verdict import Verdict, first_few
from kinertia.diagnostics.result.warnings import FORCE_MASS_TOLERANCE
from kinertia.diagnostics.subject.force_mass import CONTRADICTING_MASS, UNMEASURED_HINT, unit_hint
from kinertia.diagnostics.subject.telling_movements import TellingMovements
from kinertia.diagnostics.timing.trial_delays import TrialDelay, trial_delay
from kinertia.errors import KinertiaError, MarkerSetError, TrialError
from kinertia.model.gait27 import build_gait27
from kinertia.model.marker_set import MarkerSet
from kinertia.motion.kinematics import FEWEST_FRAMES, LONGEST_BRIDGE_S, facing
from kinertia.trial.data import Markers, Recording, Trial
from kinertia.trial.ground_contact import FootMarkers
from kinertia.trial.marker_quality import (
    Travel,
    Visibility,
    travel,
    visibility,
)
from kinertia.trial.plate_assignment import build_trial

OFF_PLATE_SHARE = 0.05
"""More of the firm load than this with its centre of pressure off the plate is worth a look; half of it is wrong."""
_RARE = 0.5
_LISTED = 8


@dataclass(frozen=True, eq=False)
class RecordingCheck:
    """Findings about one recording; times in s on its own clock.

    Attributes:
        recording: what was read.
        marker_set: how its labels fit.
        used_set: the marker set that fits, or None.
        markers: visibility, over the whole recording, of the set's markers, or of all where no set fits.
        travel: what the person does.
        telling: how far trunk and pelvis move, or None.
        plates: one entry per plate; empty without forces.
        windows: stretches in which every foot on the ground stands on a plate, longest first.
        mass: by the vertical force, or None.
        scale_kg: body mass as given or as the file tells, or None.
        verdicts: whether a fit can use this recording.
        notes: assumptions made while reading and sorting the loads.
        delay: of the forces against the markers, or None.

    Examples:
        >>> walk = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> check = kinertia.check_recording(walk, mass_kg=72.6)
        >>> check.marker_set.name, bool(check.windows)
        ('Cleveland Clinic', True)
    """

    recording: Recording
    marker_set: MarkerSetMatch
    used_set: MarkerSet | None
    markers: tuple[Visibility, ...]
    travel: Travel
    telling: TellingMovements | None
    plates: tuple[PlateCheck, ...]
    windows: tuple[tuple[float, float], ...]
    mass: ForceMass | None
    scale_kg: float | None
    verdicts: tuple[Verdict, ...]
    notes: tuple[str, ...]
    delay: TrialDelay | None = None

    def facts(self) -> list[tuple[str, str]]:
        """What was measured and how, as pairs of a name and a sentence."""
        markers, plates, match = self.recording.markers, self.recording.plates, self.marker_set
        rate = "" if len(markers.time) < 2 else f" at {markers.rate_hz:g} Hz, {markers.time[0]:.3f} to "
        axes = f"lengths in {self.recording.length_unit}, {self.recording.vertical} up; read as m, Y up"
        had = match.n_labels - len(match.missing)
        named = f"{match.name}{'' if match.fits else ' (the nearest preset)'}: {had} of its {match.n_labels} labels"
        missing = [label + (f" ({' or '.join(near)}?)" if near else "") for label, near in match.missing.items()]
        facts = [
            ("frames", f"{len(markers.time)}{rate}{markers.time[-1]:.3f} s" if rate else "1"),
            ("in the file", axes),
            ("the person", self.travel.sentence()),
            ("labels", f"{len(markers.labels)}, {len(match.others)} not in the marker set"),
            ("marker set", named if had else "none known"),
        ]
        if self.telling is not None:
            facts.append(("movement", self.telling.sentence()))
        if missing and had:
            facts.append(("missing labels", ", ".join(missing)))
        if plates is None:
            return [*facts, ("forces", "none")]
        rate_hz = (len(plates.time) - 1) / (plates.time[-1] - plates.time[0])
        facts.append(("forces", f"{len(plates.names)} plates at {rate_hz:.6g} Hz"))
        spans = [f"{start:.3f} to {end:.3f} s" for start, end in self.windows]
        facts.append(("all contact measured", ", ".join(spans) or "nowhere, or unknown"))
        if self.mass is not None:
            mass = self.mass
            facts.append(
                (
                    "vertical force",
                    f"{mass.mass_kg:.1f} kg, mean over {mass.over} ({mass.start_s:.2f} to {mass.end_s:.2f} s)",
                )
            )
        return facts


def check_recording(
    recording: Recording,
    marker_set: MarkerSet | None = None,
    mass_kg: float | None = None,
    window_s: tuple[float, float] | None = None,
    static: Recording | None = None,
    height_m: float | None = None,
    is_static: bool = False,
) -> RecordingCheck:
    """Look at one recording as a fit would, up to the first model.

    Args:
        recording: markers, and forces where there are any.
        marker_set: the laboratory's, or the markers of an OpenSim model; found among the presets if None.
        mass_kg: by the scale; the file's own if None.
        window_s: the stretch that the user vouches for.
        static: the static trial that goes with it, if there is one.
        height_m: stature; the file's own if None.
        is_static: it is given as the static trial; otherwise it is one if the person stands still.
    """
    match, used = match_labels(recording.markers.labels, marker_set)
    own = recording.markers
    if used is not None:
        own = own.select([label for label in used.labels if label in own.labels])
    moves, seen = travel(own), visibility(own)
    standing = moves.kind == "stands still"
    verdicts, feet = judged_labels(match), None
    if used is not None:
        feet, trouble = _feet(recording.markers.labels, used, None if static is None else static.markers.labels)
        verdicts += trouble
        if used.landmarks:
            verdicts += _facing(recording.markers, used, moves)
            verdicts += _static(recording, used) if standing else []
    delay: TrialDelay | None = None
    doubts = (
        static_doubts(recording, used, recording.height_m if height_m is None else height_m)
        if is_static or standing
        else trial_doubts(recording, used, static, feet)
    )
    verdicts = [*_verdicts(doubts), *verdicts]
    plates = check_plates(recording, feet)
    trial, notes, trial_verdicts = _trial(recording, feet, window_s, is_static or standing)
    windows = () if trial is None else tuple(trial.windows())
    within = own.cut(*windows[0]) if windows else own
    mass = None if trial is None else mass_by_strides(trial, standing)
    scale = recording.mass_kg if mass_kg is None else mass_kg
    refused = any(one.refused for one in doubts)
    # what contacts fail for follows from what was refused: a foot on the wrong plate from its points in mm
    trial_verdicts = [one for one in trial_verdicts if not (refused and one.level == "fail")]
    verdicts += [*_never(seen), *_gaps(within), *trial_verdicts, *_pressure(plates)]
    if trial is not None and used is not None:
        verdicts += _turning(trial, used)
        verdicts += [] if refused else _verdicts(motion_doubts(recording, trial, used))
        delay = None if refused or standing else trial_delay(trial, used.segments)
    verdicts += _weight(mass, scale)
    telling = None if used is None else _telling(recording.markers, used)
    return RecordingCheck(
        recording, match, used, seen, moves, telling, plates, windows, mass, scale, tuple(verdicts), tuple(notes), delay
    )


def _telling(markers: Markers, marker_set: MarkerSet) -> TellingMovements | None:
    pelvis, torso = (marker_set.segments.get(name, ()) for name in ("pelvis", "torso"))
    return TellingMovements.of(markers, pelvis, torso)


def _never(seen: Sequence[Visibility]) -> list[Verdict]:
    """Markers that no frame shows; a fit leaves them out, and says what it then lacks."""
    never = [one.label for one in seen if one.share == 0.0]
    if not never:
        return []
    return [
        Verdict("caution", f"visible in no frame, left out: {first_few(never, _LISTED)}; label them if they were worn")
    ]


def _gaps(markers: Markers) -> list[Verdict]:
    """Gaps of the markers within the frames that a fit would use."""
    shown = [one for one in visibility(markers) if one.share > 0.0]
    rare = [f"{one.label} ({100 * one.share:.0f} %)" for one in shown if one.share < _RARE]
    long = [
        f"{one.label} ({one.longest_gap_s:.2f} s)"
        for one in shown
        if one.share >= _RARE and one.longest_gap_s > LONGEST_BRIDGE_S
    ]
    where = f"from {markers.time[0]:.3f} to {markers.time[-1]:.3f} s"
    verdicts = []
    if rare:
        verdicts.append(Verdict("caution", f"seen in less than half of the frames {where}: {first_few(rare, _LISTED)}"))
    if long:
        verdicts.append(
            Verdict("caution", f"gaps longer than {LONGEST_BRIDGE_S:g} s {where}: {first_few(long, _LISTED)}")
        )
    return verdicts or [Verdict("pass", f"no marker has a gap longer than {LONGEST_BRIDGE_S:g} s {where}")]


def _feet(
    labels: Sequence[str], marker_set: MarkerSet, standing: Sequence[str] | None
) -> tuple[FootMarkers | None, list[Verdict]]:
    """Labels on each foot, None unless both have one; and what else a fit would refuse for want of markers.

    A trunk need not be seen, but if the static trial shows it (`standing`: its labels), the motion has to.
    """
    feet = {side: [label for label in own if label in labels] for side, own in marker_set.foot_labels().items()}
    spare = {"upper_arm_r", "upper_arm_l", "forearm_r", "forearm_l"}
    if standing is None or not set(marker_set.segments.get("torso", ())) & set(standing):
        spare.add("torso")
    needed = set(marker_set.segments) - spare if marker_set.landmarks else {"foot_r", "foot_l"}
    bare = [
        segment
        for segment, own in marker_set.segments.items()
        if segment in needed and (own or not marker_set.landmarks) and not set(own) & set(labels)
    ]
    verdicts = []
    if bare:
        verdicts.append(Verdict("fail", f"no marker of {', '.join(bare)}: a fit needs at least one on each"))
    return (feet if all(feet.values()) else None), verdicts


def _verdicts(doubts: Sequence[Doubt]) -> list[Verdict]:
    return [Verdict("fail" if refused else "caution", sentence) for sentence, refused in doubts]


def _facing(markers: Markers, marker_set: MarkerSet, moves: Travel) -> list[Verdict]:
    try:
        rotation, _ = facing(markers, marker_set)
    except MarkerSetError as error:
        return [Verdict("fail", str(error))]
    if moves.kind != "walks":
        return []
    angle = np.radians(moves.direction_deg)
    forward = rotation.T @ np.array([1.0, 0.0, 0.0])
    if forward @ np.array([np.cos(angle), 0.0, -np.sin(angle)]) > 0:
        return []
    return [
        Verdict(
            "caution", "by the pelvis markers the person walks backwards; if not so, left and right labels are swapped"
        )
    ]


def _static(recording: Recording, marker_set: MarkerSet) -> list[Verdict]:
    """Whether the model can be built from this static trial; that depends on neither stature nor sex."""
    try:
        build_gait27(recording, marker_set, 1.7, "male")
    except KinertiaError as error:
        return [Verdict("fail", f"no model can be built from this static trial: {error}")]
    return [Verdict("pass", "the person stands still, with all landmarks that the model needs: a static trial")]


def _trial(
    recording: Recording, feet: FootMarkers | None, window_s: tuple[float, float] | None, standing: bool
) -> tuple[Trial | None, tuple[str, ...], list[Verdict]]:
    """The loads sorted by foot, notes, and whether all ground contact is known somewhere."""
    if recording.plates is None:
        why = f" ({'; '.join(recording.left_out)})" if recording.left_out else ""
        sentence = f"no forces{why}: a fit needs them; name the force file too, or a C3D file with plates"
        return None, recording.notes, [] if standing else [Verdict("caution", sentence)]
    if feet is None:
        return None, recording.notes, []
    try:
        trial = build_trial(recording, feet, window_s)
    except KinertiaError as error:
        problem = error.problem if isinstance(error, TrialError) else str(error)
        return None, recording.notes, [] if standing else [Verdict("fail", problem)]
    return trial, trial.notes, [] if standing else [_measured(trial, window_s is not None)]


def _measured(trial: Trial, by_user: bool) -> Verdict:
    start, end = trial.windows()[0]
    frames = len(trial.markers.cut(start, end).time)
    what = "the user's window goes" if by_user else "every foot on the ground stands on a plate"
    sentence = f"{what} from {start:.3f} to {end:.3f} s ({frames} frames)"
    if frames < FEWEST_FRAMES:
        return Verdict("fail", f"{sentence}; a fit needs at least {FEWEST_FRAMES} frames")
    return Verdict("pass", sentence)


def _pressure(plates: Sequence[PlateCheck]) -> list[Verdict]:
    known = [plate for plate in plates if plate.outside_share is not None]
    off = [(plate, plate.outside_share) for plate in known if (plate.outside_share or 0.0) > OFF_PLATE_SHARE]
    if known and not off:
        return [Verdict("pass", "the centres of pressure lie on the plates")]
    return [
        Verdict(
            "fail" if share > 0.5 else "caution",
            f"{plate.name}: the centre of pressure is off the plate in {100 * share:.0f} % of the loaded samples, by "
            f"up to {100 * plate.outside_m:.0f} cm; check the plate's corners, origin and units",
        )
        for plate, share in off
        if share is not None
    ]


def _turning(trial: Trial, marker_set: MarkerSet) -> list[Verdict]:
    markers = trial.markers.cut(*trial.windows()[0])
    worn = [label for label in marker_set.segments.get("pelvis", ()) if label in markers.labels]
    pelvis = markers.select(worn).positions
    seen = np.isfinite(pelvis).all(axis=(1, 2))
    if not worn or not seen.any():
        return []
    turning = mean_turning(trial.loads, markers.time[seen], pelvis[seen].mean(axis=1))
    return [] if turning is None else [Verdict("caution" if turning.contradicts else "pass", turning.sentence())]


def _weight(mass: ForceMass | None, scale_kg: float | None) -> list[Verdict]:
    if mass is None or scale_kg is None:
        return []
    off = mass.mass_kg / scale_kg - 1
    sentence = (
        f"the vertical force corresponds to {mass.mass_kg:.1f} kg (mean over {mass.over}); "
        f"stated mass {scale_kg:.1f} kg ({100 * off:+.1f} %)"
    )
    if abs(off) <= FORCE_MASS_TOLERANCE:
        return [Verdict("pass", sentence)]
    if hint := unit_hint(mass.mass_kg, scale_kg):
        return [Verdict("fail", f"{hint}: {sentence}")]
    return [
        Verdict(
            "fail" if abs(off) > CONTRADICTING_MASS else "caution",
            f"{sentence}; check the mass, and the gain and zero of the plates"
            + (f", {UNMEASURED_HINT}" if off < 0 else ""),
        )
    ]
