"""Holds one person with all recordings, and decides which of two that disagree is the odd one."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from kinertia.diagnostics.context import RecordingContext
from kinertia.estimation.prepare.prepared import TotalMass
from kinertia.findings.finding import Finding, Severity
from kinertia.model.imported_model import OsimModel
from kinertia.model.marker_set import MarkerSet
from kinertia.settings import Subject

T = TypeVar("T")


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
            one.severity is Severity.ERROR and one.where.trial == trial and one.code.startswith(codes)
            for one in self.found
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
