"""Tabulates what one recording holds: facts for the terminal, the page and scripts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.labels.marker_set_match import MarkerSetMatch, match_labels
from kinertia.diagnostics.plates.plate_summary import PlateCheck, check_plates
from kinertia.diagnostics.subject.movements import InformativeMovements, task_of
from kinertia.diagnostics.subject.stance_coverage import coverage_of
from kinertia.findings.finding import Finding
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Recording
from kinertia.trial.marker_quality import Travel, Visibility, visibility


@dataclass(frozen=True, eq=False)
class RecordingCheck:
    """Facts and findings of one recording; times in s on its own time base.

    Attributes:
        context: the context in which the questions were asked.
        marker_set: how the labels fit.
        markers: visibility over the whole recording of the set's markers, or of all where no set fits.
        movements: how far trunk and pelvis move, or None.
        plates: one entry per plate; empty without forces.
        windows: windows in which every foot on the ground stands on a plate, longest first.
        findings: findings of this recording, with what explains and what overrules them.

    Examples:
        >>> check = kinertia.check_recording(kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot"))
        >>> check.travel.kind, len(check.plates), len(check.windows)
        ('walks', 2, 1)
    """

    context: RecordingContext
    marker_set: MarkerSetMatch
    markers: tuple[Visibility, ...]
    movements: InformativeMovements | None
    plates: tuple[PlateCheck, ...]
    windows: tuple[tuple[float, float], ...]
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, context: RecordingContext, findings: Sequence[Finding]) -> Self:
        """Collect facts and findings of a screened recording; `findings` are the whole person's."""
        recording, used = context.recording, context.marker_set
        trial = context.trial
        movements = None
        if used is not None:
            pelvis, torso = (used.segments.get(name, ()) for name in ("pelvis", "torso"))
            movements = InformativeMovements.of(recording.markers, pelvis, torso)
        return cls(
            context,
            match_labels(recording.markers.labels, used)[0],
            visibility(context.markers),
            movements,
            check_plates(recording, context.feet),
            () if trial is None else tuple(trial.windows()),
            tuple(one for one in findings if one.where.trial == context.name),
        )

    @property
    def recording(self) -> Recording:
        """The recording as read."""
        return self.context.recording

    @property
    def used_set(self) -> MarkerSet | None:
        """The marker set that fits, or None."""
        return self.context.marker_set

    @property
    def travel(self) -> Travel:
        """Movement of the person: walking, standing still, or moving on the spot."""
        return self.context.travel

    def facts(self) -> list[tuple[str, str]]:
        """Describe what was measured and how, as pairs of a name and a sentence."""
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
            *([] if self.context.is_static else [("task", task_of(self.context))]),
            ("labels", f"{len(markers.labels)}, {len(match.others)} not in the marker set"),
            ("marker set", named if had else "none known"),
        ]
        if self.movements is not None and not self.context.is_static:
            facts.append(("movement", self.movements.sentence()))
        if missing and had:
            facts.append(("missing labels", ", ".join(missing)))
        if plates is None:
            return [*facts, ("forces", "none")]
        rate_hz = (len(plates.time) - 1) / (plates.time[-1] - plates.time[0])
        legs = coverage_of(self.context)
        spans = [f"{start:.3f} to {end:.3f} s" for start, end in sorted(self.windows)]
        return [
            *facts,
            ("forces", f"{len(plates.names)} plates at {rate_hz:.6g} Hz"),
            ("complete contact", ", ".join(spans) or "nowhere, or unknown"),
            *([("joint moments", "; ".join(leg.sentence for leg in legs))] if legs else []),
        ]
