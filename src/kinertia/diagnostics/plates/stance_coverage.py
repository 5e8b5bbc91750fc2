"""Will each leg have joint moments in all of stance, in any trial of a task? Predicted from contacts."""

from collections.abc import Iterator, Sequence

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.runner import check
from kinertia.diagnostics.subject.movements import task_of
from kinertia.findings.finding import Finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.stances import LegCoverage, joined_coverage, leg_coverage, listed
from kinertia.trial.trial_input import GAIT, Task


def coverage_of(context: RecordingContext) -> tuple[LegCoverage, ...]:
    """Predict the part of stance and stride of each leg that will have joint moments; empty without strides."""
    trial = context.trial_on_plates or context.trial
    if trial is None or context.is_static or task_of(context) not in GAIT:
        return ()
    return leg_coverage(trial, trial.known_legs)


@check("P272", "P289")
def stance_coverage(context: PersonContext) -> Iterator[Finding]:
    """Report P272: a phase of a leg's stance is on plates in no trial of a task; P289: hardly anything of it is.

    Not where the user states the window of every trial.
    """
    by_task: dict[Task, list[RecordingContext]] = {}
    for one in context.trials:
        by_task.setdefault(task_of(one), []).append(one)
    for task, trials in by_task.items():
        if all(one.window_s is not None for one in trials):
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
