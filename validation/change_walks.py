"""Measures people who walked several times: in one condition, where nothing changed, and in others."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy import stats

from kinertia.estimation.changes.change import Change
from kinertia.estimation.changes.condition_changes import changes_of_strides
from kinertia.estimation.changes.stride_features import Rows, stride_features, usual_sources
from kinertia.estimation.result.fit import Fit
from kinertia.workflow.from_files import fit_subject

DRAWS = 80
_ASSUMED_FREEDOM = 12
"""Degrees of freedom of a difference of two single strides whose spread is assumed."""
NORMAL = ("walking1", "walking2")
INSTRUCTED = {"toes in": "walkingTI1", "toes out": "walkingTO1", "trunk sway": "walkingTS1"}
SUBJECT4 = "subject4, walks"
_TRC = """[[trial]]
markers = "{lab}/{trial}.trc"
forces = "{lab}/{trial}_grf.mot"
"""


@dataclass(frozen=True)
class Walker:
    """A measured person.

    Attributes:
        title: of the person on the page.
        folder: of the recordings.
        trials: compared in pairs; each in halves if `halves`.
        text: of the subject file, without trials; empty where the folder has a subject file.
        halves: whether strides of a trial are compared, the first half with the second, and odd with even ones.
    """

    title: str
    folder: str
    trials: Sequence[str]
    text: str = ""
    halves: bool = False

    def fit(self, data: Path, work: Path) -> Fit:
        """Estimate from all trials together."""
        lab = data / self.folder
        if not self.text:
            return fit_subject(lab / "subject.toml")
        subject = work / f"{self.title.replace(' ', '-')}.toml"
        parts = [self.text.format(lab=lab)]
        for trial in (*self.trials, *(INSTRUCTED.values() if self.title == SUBJECT4 else ())):
            loads = lab / f"{trial}_external_forces.xml"
            parts.append(_TRC.format(lab=lab, trial=trial) + (f'loads = "{loads}"\n' if loads.exists() else ""))
        subject.write_text("".join(parts), encoding="utf-8")
        return fit_subject(subject)


WALKERS = (
    Walker(
        SUBJECT4,
        "subject4",
        NORMAL,
        '[subject]\nname = "subject4"\nsex = "male"\nmass_kg = 62.6\n'
        '[model]\nosim = "{lab}/addbiomechanics_scaled.osim"\ncalibrate = true\n',
    ),
    Walker(
        "Hamner's treadmill, runs",
        "field/hamner_treadmill_run",
        ("run200", "run300"),
        '[subject]\nname = "Hamner"\nsex = "male"\nmass_kg = 72.84\n[model]\nosim = "{lab}/final.osim"\n',
        halves=True,
    ),
    Walker("Clinic Sydney, walks", "field/sydney", ("S4-AMGait03", "S4-AMGait04", "S4-AMGait05")),
    Walker("Clinic FMC, walks", "field/fmc", ("MH0222_BP06", "MH0222_BP15")),
)


def measured(walker: Walker, data: Path, work: Path) -> Rows:
    """Return the features of all strides of a person."""
    fit = walker.fit(data, work)
    return stride_features(fit, fit.trials, usual_sources(fit), DRAWS).events


def unchanged_pairs(walker: Walker, rows: Rows) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the rows of two groups of strides of one condition."""
    trials = np.array([key[0] for key in rows.keys])
    if not walker.halves:
        for first, other in combinations(walker.trials, 2):
            yield trials == first, trials == other
        return
    sides, strides = (np.array([key[k] for key in rows.keys]) for k in (2, 3))
    numbers = np.array([int(stride.split()[-1]) if stride.startswith("stride") else -1 for stride in strides])
    for trial in walker.trials:
        of_trial = (trials == trial) & (numbers > 0)
        halves = np.zeros(len(of_trial), dtype=bool)
        for side in "rl":
            mine = of_trial & (sides == side)
            halves |= mine & (numbers <= np.ceil(numbers[mine].max(initial=0) / 2.0))
        yield of_trial & halves, of_trial & ~halves
        yield of_trial & (numbers % 2 == 1), of_trial & (numbers % 2 == 0)


def judged_pairs(walker: Walker, rows: Rows) -> list[list[Change]]:
    """Judge all pairs of one condition."""
    return [list(changes_of_strides(rows, pair)) for pair in unchanged_pairs(walker, rows)]


def beyond(change: Change) -> bool | None:
    """Decide whether a difference is beyond 95 %, single strides with their assumed spread; None if unknown."""
    if np.isfinite(change.mdc95):
        return abs(change.difference) > change.mdc95
    if not change.assumed:
        return None
    return bool(abs(change.difference) > stats.t.ppf(0.975, _ASSUMED_FREEDOM) * change.sd)


def group(change: Change) -> str:
    """Return the joint group of a change."""
    return f"{change.quantity} {change.joint}"


def alarm_shares(pairs: Sequence[Sequence[Change]]) -> Mapping[str, tuple[int, int]]:
    """Return how many of how many differences are beyond 95 %, by joint group."""
    counts: dict[str, tuple[int, int]] = {}
    for pair in pairs:
        for change in pair:
            if (found := beyond(change)) is not None:
                alarms, all_of = counts.get(group(change), (0, 0))
                counts[group(change)] = alarms + found, all_of + 1
    return counts


def instructed_changes(rows: Rows) -> dict[str, list[Change]]:
    """Compare the normal walks of subject4 with each instructed one."""
    trials = np.array([key[0] for key in rows.keys])
    normal = np.isin(trials, NORMAL)
    return {name: list(changes_of_strides(rows, (normal, trials == number))) for name, number in INSTRUCTED.items()}
