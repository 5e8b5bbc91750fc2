"""Tiny people for tests of cohorts, and what goes wrong while they are fitted."""

import re
from pathlib import Path
from unittest import mock

import numpy as np

from kinertia.cohort.job import Job
from kinertia.cohort.record import Record
from kinertia.cohort.worker import fit_person, main
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.walk import walk, walking_subject

SHORTEST_S, RATE_HZ = 1.4, 50.0
HANGING = "Ben"


def write_study(folder: Path, names: tuple[str, ...]) -> Path:
    """People with the shortest walk that has a whole contact of each foot, in a folder each."""
    subject = walking_subject()
    trial = walk(subject, SHORTEST_S, RATE_HZ)
    for k, name in enumerate(names):
        path = write_lab(folder / name, record(subject, trial, LabNoise(), np.random.default_rng(k)))
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace('name = "synthetic walker"', f'name = "{name}"'), encoding="utf-8")
    return folder


def hang(wanted: object) -> None:
    """As a reader in compiled code does: nothing else of the process runs any more."""
    re.match("(a+)+b", "a" * 60)


def fit_person_unless_hanging(job: Job) -> Record:
    """What a worker does, where the files of one person hang the reader."""
    if job.person != HANGING:
        return fit_person(job)
    with mock.patch("kinertia.cohort.worker.read_subject", hang):
        return fit_person(job)


if __name__ == "__main__":
    main(fit_person_unless_hanging)
