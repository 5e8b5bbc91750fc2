"""Defines a job of a cohort, one person to fit, and guesses how long jobs take."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Self
from uuid import uuid4

from kinertia.cohort.record import FAILED, Record, Standing, one_line
from kinertia.io.versions import VERSION

RETRIES = 2
"""How often the fit of a person whose process was killed is repeated."""
_SECONDS_PER_PERSON, _SECONDS_PER_FRAME = 4.0, 0.003
"""Times of one processor, for a rough guess before any measurement: see `docs/validation/long-trials.md`."""
_LEAST_LIMIT_S, _PATIENCE = 900.0, 50.0
"""A fit is given so long, and so many times the guess: what takes longer has no end."""


@dataclass(frozen=True)
class Job:
    """One person to fit.

    Attributes:
        person: name of the person.
        subject: the subject file.
        cohort: folder of the cohort's results, as workers see it.
        inputs: SHA-256 of what goes into the fit.
        trials: number of trials.
        limit_s: time after which its process is ended.
        kinertia: version of the command, which has to be the worker's.
        run: identifier of the job, of which each run of the command has another.
    """

    person: str
    subject: Path
    cohort: Path
    inputs: str
    trials: int
    limit_s: float
    kinertia: str = VERSION
    run: str = field(default_factory=lambda: uuid4().hex)

    @classmethod
    def of(cls, one: Standing, cohort: Path) -> Self:
        """Create the job of fitting a person who is due, into the folder of the cohort."""
        if one.person.subject is None:
            raise ValueError(f"{one.person.name} is not due")
        limit_s = _LEAST_LIMIT_S + _PATIENCE * guessed_seconds([one], 1)
        return cls(one.person.name, one.person.subject.resolve(), cohort, one.inputs, one.trials, limit_s)

    @classmethod
    def of_text(cls, text: str) -> Self:
        """Read `text`."""
        entries = json.loads(text)
        paths = {name: Path(entries[name]) for name in ("subject", "cohort")}
        return cls(**{**entries, **paths})

    @property
    def text(self) -> str:
        """The job in one line, for another process."""
        return json.dumps(asdict(self), default=str)

    def killed(self, times: int = RETRIES + 1) -> Record:
        """Return the record of a person whose process was killed each time."""
        sentence = (
            f"the process that fitted it was killed {times} times, probably for lack of memory; the next run tries "
            "again: close other programs, or use a computer with more memory"
        )
        return self.record(FAILED, sentence, settled=False)

    def record(self, status: int, sentence: str, settled: bool, seconds: float = 0.0) -> Record:
        """Return the record of how it ended; `settled` where the same input always ends so."""
        inputs = self.inputs if settled else ""
        return Record(self.person, status, one_line(sentence), inputs, self.kinertia, self.trials, round(seconds, 1))


def guessed_seconds(due: Sequence[Standing], workers: int) -> float:
    """Estimate roughly how long fits take (s), with one processor for each process."""
    each = [_SECONDS_PER_PERSON + _SECONDS_PER_FRAME * one.frames for one in due]
    return max(sum(each) / workers, max(each, default=0.0))
