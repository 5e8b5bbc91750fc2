"""Determines what changed between two sessions or conditions, from files, folders or results: `kinertia.compare`.

What all trials of one estimate share cancels in a difference, and what the estimate corrects is in its deviations. What
remains are errors of one condition only, and errors that a user waived.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinertia.errors import FileError, KinertiaError
from kinertia.estimation.changes.change import Change, gait_changes, group_changes, profile_changes, speed_change
from kinertia.estimation.changes.condition_changes import (
    changes_of_strides,
    condition_among,
    condition_features,
    conditions_of,
    expect_two,
    masks_of,
)
from kinertia.estimation.changes.curve_changes import CurveChange, apart, curve_changes, paired, rows_of
from kinertia.estimation.changes.session_changes import (
    Session,
    changes_between,
    grows,
    identity_note,
    instrument_doubts,
    one_session_note,
    other_sex,
    session,
    session_features,
    tasks_note,
    unjudged_changes,
    why_incomparable,
    why_unjudged,
)
from kinertia.estimation.prepared import Prepared, Progress
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.mean_cycles import check_convention, expect_all_nine
from kinertia.io.norms_file import Norm, read_norms
from kinertia.io.recording import MARKER_FILES
from kinertia.io.subject.provenance import sha256
from kinertia.io.subject.reader import read_subject
from kinertia.io.subject.tables import SubjectFile
from kinertia.report.comparison.change_tables import (
    RELEVANT,
    change_rows,
    change_sentences,
    changed_sentence,
    changes_summary,
    curve_figures,
    group_columns,
    lacking_sentence,
    limit_sentences,
    person_columns,
    shown_changes,
    shown_curves,
    speed_sentence,
)
from kinertia.report.exports.saved_fit import FIT_FILE, load_fit
from kinertia.report.figures.coordinate_titles import OutcomeSigns, outcome_signs, same_sign
from kinertia.report.pages.rendering import rendered
from kinertia.workflow.estimate import estimate
from kinertia.workflow.from_files import fit_subject, prepare_subject

if TYPE_CHECKING:
    import pandas as pd

_NARROW = (
    "A saved result assumes markers placed within 5 mm; between days, angles differ by more than its intervals allow. "
    "Compare the subject files instead."
)
Norms = Mapping[str, Norm] | None
Source = Fit | SubjectFile | str | Path
MARKER_SD_M = 0.010
"""Of marker positions in their segments: 5 mm each, and 5 mm that markers of a segment share. Independent errors of 10
mm are as large; with 7 mm, intervals of hip and pelvis angles held the truth of synthetic people in 69 to 85 %."""


@dataclass(frozen=True)
class Comparison:
    """What changed between two sessions or conditions.

    Attributes:
        before, after: their names.
        outcomes: joint moments and angles, event by event.
        speed: walking speed, which changes moments; None where it is not known.
        gait: cadence, stride length, share of stance and step width, where they are known; gait profile with norms.
        curves: joint moments and angles over the gait cycle, or over stance.
        doubt: findings about instruments that keep changes of moments from being judged.
        note: what else limits the comparison; empty if nothing does.
        person: whether both are of one person, where that is in question; else empty.
        signs: of sentences and pages; the other attributes, and files, have the library's.

    Examples:
        >>> found = kinertia.compare("before/subject.toml", "after/subject.toml")  # doctest: +SKIP
        >>> [one.difference for one in found.outcomes if one.verdict == "changed"]  # doctest: +SKIP
    """

    before: str
    after: str
    outcomes: tuple[Change, ...]
    speed: Change | None
    gait: tuple[Change, ...] = ()
    curves: tuple[CurveChange, ...] = ()
    doubt: str = ""
    note: str = ""
    person: str = ""
    signs: OutcomeSigns = field(default_factory=dict, repr=False)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Walking speed, each outcome that was named beforehand, how many of the others changed, and limits."""
        shown = shown_changes(self.outcomes, self.signs)
        said = speed_sentence(self.speed), *change_sentences(shown), lacking_sentence(shown), changed_sentence(shown)
        limits = (*limit_sentences(self.outcomes, self.doubt), self.note)
        return tuple(filter(None, (self.person, *said, *limits)))

    @property
    def steps(self) -> tuple[Change, ...]:
        """Walking speed, where it is known, and `gait`."""
        return (() if self.speed is None else (self.speed,)) + self.gait

    def shown(self) -> dict[str, Any]:
        """Return what the templates show of it."""
        return {
            "before": self.before,
            "after": self.after,
            "sentences": self.sentences,
            "rows": change_rows(shown_changes(self.outcomes, self.signs)),
            "gait": change_rows(self.steps),
            "figures": curve_figures(shown_curves(self.curves, self.signs), self.before, self.after),
            "relevant": RELEVANT,
        }

    def page(self) -> str:
        """Render the page of conditions of one session."""
        return rendered("changes_page.html.j2", title=f"{self.before} and {self.after}", changes=self.shown())

    @property
    def summary(self) -> dict[str, Any]:
        """What `kinertia compare --json` prints of it."""
        found = changes_summary(self.before, self.after, self.outcomes, self.speed, self.gait)
        return {**found, "doubt": self.doubt, "note": self.note, "person": self.person}


@dataclass(frozen=True)
class GroupComparison:
    """What changed in a group: `people` by name, each before and after.

    Examples:
        >>> found = kinertia.compare_group({"Anna": anna, "Ben": ben})  # doctest: +SKIP
        >>> found.means.query("changed > 0")[["joint", "component", "difference", "sd_true"]]  # doctest: +SKIP
    """

    people: Mapping[str, Comparison]

    @property
    def changes(self) -> pd.DataFrame:
        """One row per person and outcome, walking speed and steps first: for mixed models."""
        import pandas as pd

        tables = (person_columns(name, (*person.steps, *person.outcomes)) for name, person in self.people.items())
        return pd.concat([pd.DataFrame(columns) for columns in tables], ignore_index=True)

    @property
    def means(self) -> pd.DataFrame:
        """One row per outcome: mean change with its 95 % interval, and how differently people changed."""
        import pandas as pd

        every = {name: (*person.steps, *person.outcomes) for name, person in self.people.items()}
        return pd.DataFrame(group_columns(group_changes(every)))


def compare_group(people: Mapping[str, Comparison]) -> GroupComparison:
    """Average what changed in each person (`compare`) over a group: a paired comparison.

    Args:
        people: by name, each with the same two conditions.

    Raises:
        KinertiaError: nobody is given.
    """
    if not people:
        raise KinertiaError("give at least one person")
    return GroupComparison(people)


def compare(
    before: Fit | str | Path,
    after: Fit | str | Path | None = None,
    conditions: tuple[str, str] | None = None,
    progress: Progress = lambda stage, share: None,
    norms: str | Path | None = None,
) -> Comparison:
    """Determine what changed: joint moments and angles, event by event.

    Args:
        before, after: two sessions of one person: subject files, folders of results, or results. Without `after`,
            `conditions` of the first are compared.
        conditions: of the trials before and after, as their `condition` in the subject file.
        progress: called as the work progresses, with a stage's name and the share of it that is done.
        norms: CSV file of `kinertia norms`: adds the Gait Profile Score of each side.

    Raises:
        KinertiaError: they cannot be compared; it says why.
    """
    sources = opened([before] if after is None else [before, after], conditions)
    known = None if norms is None else read_norms(norms)
    if after is None:
        (source,) = sources
        fit = fit_subject(source, progress) if isinstance(source, SubjectFile) else source
        assert conditions is not None
        return _of_conditions(fit, conditions, progress, known)
    found = _of_sessions([fit_of(source, progress) for source in sources], conditions, progress, known)
    return noted(found, one_session_note(sources))


def noted(found: Comparison, more: str) -> Comparison:
    """Return a comparison with one more limit of it, unless that is empty."""
    return replace(found, note=" ".join(filter(None, (found.note, more))))


def opened(sources: Sequence[Source], conditions: tuple[str, str] | None) -> list[Fit | SubjectFile]:
    """Read results and subject files, and make sure before any estimate that they can be compared.

    Args:
        sources: one session, of which conditions are compared, or several.
        conditions: that the user chose, if any.

    Raises:
        KinertiaError: one is neither, cannot be read, or lacks its condition; two are of different sexes, or share a
            recording.
    """
    if len(sources) == 1 and conditions is None:
        raise KinertiaError("give two sessions, or two conditions of one")
    if len(sources) == 1 and conditions is not None:
        expect_two(*conditions)
    found = [_opened(source) for source in sources]
    if len(found) <= 2:
        for source, wanted in zip(found * 2 if len(found) == 1 else found, conditions or (None, None), strict=False):
            condition_among(_stated(source), source.subject.name, wanted)
    files = any(isinstance(source, SubjectFile) for source in found)
    if len(found) == 2 and files and (why := other_sex(*(source.subject for source in found))):
        raise KinertiaError(why)
    hashes = [
        {sha256(trial.markers): trial.markers for trial in source.trials} if isinstance(source, SubjectFile) else {}
        for source in found
    ]
    for first, other in combinations(hashes, 2):
        for content in first.keys() & other.keys():
            raise FileError(first[content], "is a recording of both subject files, so nothing can have changed in it")
    return found


def _opened(source: Source) -> Fit | SubjectFile:
    if isinstance(source, Fit | SubjectFile):
        return source
    path = Path(source)
    if path.name == FIT_FILE:
        return load_fit(path.parent)
    if path.is_dir():
        subject = path / "subject.toml"
        return read_subject(subject) if subject.is_file() and not (path / FIT_FILE).is_file() else load_fit(path)
    if path.suffix.lower() in MARKER_FILES:
        raise FileError(path, "is a recording; give a subject file, which kinertia init drafts, or a folder of results")
    return read_subject(path)


def _stated(source: Fit | SubjectFile) -> list[str]:
    """Return the conditions of all trials that are compared."""
    if isinstance(source, Fit):
        return list(conditions_of(source))
    return [trial.condition for trial in source.trials if trial.use == "all"]


def _of_conditions(fit: Fit, conditions: tuple[str, str], progress: Progress, norms: Norms) -> Comparison:
    """Compare two conditions of one estimate."""
    first, other = (session(fit, name) for name in conditions)
    features, condition = condition_features(fit, *conditions, partial(progress, "comparison"))
    found = changes_of_strides(features.events, masks_of(features.events, condition, *conditions))
    early, late = (rows_of(features.curves, mask) for mask in masks_of(features.curves, condition, *conditions))
    return _comparison(conditions, first, other, found, curve_changes(early, late, paired), norms)


def _of_sessions(
    fits: Sequence[Fit], conditions: tuple[str, str] | None, progress: Progress, norms: Norms
) -> Comparison:
    """Compare two sessions of one person."""
    before, after = fits
    first, other = (session(fit, name) for fit, name in zip(fits, conditions or (None, None), strict=True))
    if reason := why_incomparable(before, after):
        raise KinertiaError(reason)
    names, person = conditions or ("before", "after"), identity_note(before, after)
    if doubt := why_unjudged(before, after):
        skeletons = before.skeleton, after.skeleton
        unjudged = unjudged_changes(
            first, other, doubt, lambda name, side: same_sign(name, side, *skeletons) if side else 0
        )
        return replace(_comparison(names, first, other, unjudged, (), norms), person=person)
    rows, later = session_features(first, other, partial(progress, "comparison"))
    outcomes = changes_between(rows.events, later.events, first.fixed_axes or other.fixed_axes)
    curves = curve_changes(rows.curves, later.curves, apart)
    found = _comparison(names, first, other, outcomes, curves, norms)
    narrow = _NARROW if first.narrow_markers or other.narrow_markers else ""
    found = noted(replace(found, person=person), narrow)
    return found if not person or grows(before) else _doubted(found, person)


def _doubted(found: Comparison, why: str) -> Comparison:
    """Let nothing be judged."""
    outcomes, gait = (tuple(replace(change, doubt=why) for change in some) for some in (found.outcomes, found.gait))
    speed = None if found.speed is None else replace(found.speed, doubt=why)
    return replace(found, outcomes=outcomes, gait=gait, speed=speed)


def compared_sessions(
    fits: Sequence[Fit],
    conditions: tuple[str, str] | None = None,
    progress: Progress = lambda stage, share: None,
    norms: str | Path | None = None,
) -> tuple[Comparison | None, str]:
    """Return what changed between two results, or why that cannot be determined.

    Raises:
        KinertiaError: their `conditions` cannot be compared, or norms do not fit.
    """
    if len(fits) != 2:
        return None, f"they are compared between two sessions, and these are {len(fits)}"
    before, after = fits
    if reason := why_incomparable(before, after):
        return None, reason
    try:
        return compare(before, after, conditions, progress, norms), ""
    except KinertiaError as error:  # results of several conditions may be compared otherwise
        if conditions is not None or norms is not None:
            raise
        return None, str(error)


def _comparison(
    names: tuple[str, str],
    first: Session,
    other: Session,
    outcomes: Iterable[Change],
    curves: Iterable[CurveChange],
    norms: Norms,
) -> Comparison:
    """Add speed, steps and doubts about instruments."""
    doubts = instrument_doubts((first.fit, first.trials), (other.fit, other.trials))
    doubt = " ".join(dict.fromkeys(doubts.values()))
    judged = tuple(
        replace(outcome, doubt=outcome.doubt or (doubts.get(outcome.side, "") if outcome.quantity == "moment" else ""))
        for outcome in outcomes
    )
    walks = first.trials, other.trials
    gait = gait_changes(*walks) + (() if norms is None else _profiles(first, other, norms))
    note, signs = tasks_note(walks), outcome_signs(first.fit)
    return Comparison(*names, judged, speed_change(*walks), gait, tuple(curves), doubt, note, signs=signs)


def _profiles(first: Session, other: Session, norms: Mapping[str, Norm]) -> tuple[Change, ...]:
    expect_all_nine(norms)
    for side in (first, other):
        check_convention(side.fit, norms)
    return profile_changes(first.trials, other.trials, norms)


def fit_of(source: Fit | SubjectFile, progress: Progress) -> Fit:
    """Return a result, or estimate it from a subject file as one of two sessions."""
    return source if isinstance(source, Fit) else fit_session(source, progress)


def fit_session(subject: Path | SubjectFile, progress: Progress = lambda stage, share: None) -> Fit:
    """Estimate a session from its subject file.

    Axes of knees, ankles and elbows of the built-in model are estimated where there is a static trial, unless the file
    settles `joint_axes`.

    Raises:
        KinertiaError: a file is missing or broken, or something in it cannot be used.
    """
    wanted = subject if isinstance(subject, SubjectFile) else read_subject(subject)
    if wanted.settings.joint_axes is None and wanted.model.osim is None and wanted.model.static is not None:
        settings = wanted.settings.model_copy(update={"joint_axes": True})
        wanted = wanted.model_copy(update={"settings": settings})
    return estimate(with_markers_anew(prepare_subject(wanted, progress)), progress)


def with_markers_anew(ready: Prepared) -> Prepared:
    """Let marker positions be as uncertain as between two sessions."""
    known = ready.uncertainty
    if known.marker_sd_m is None:
        return ready
    return replace(ready, uncertainty=replace(known, marker_sd_m=max(known.marker_sd_m, MARKER_SD_M)))
