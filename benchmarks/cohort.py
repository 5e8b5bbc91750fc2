"""What a cohort costs beside its single fits, and how memory grows with its people: writes docs/cohort-speed.md.

    python benchmarks/cohort.py                 # 200 people and 50: an hour on two quiet cores
    python benchmarks/cohort.py --people 8 --fewer 4 --dry-run

Synthetic people, each with a body drawn from the literature's prior, walk past two plates; their files are written as a
laboratory's. Single fits run one after the other in one process that does what a worker does; the cohort is the
command, from its start to its end. Memory is that of all its processes together, looked at twice a second.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import psutil

from kinertia.estimation.prior import literature_prior
from kinertia.report.cohort_person import fit_person
from kinertia.studies.cohort_cluster import Job, local_size
from kinertia.studies.cohort_people import people_of
from kinertia.studies.cohort_record import prepare_folder, standings
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.walk import walk, walking_subject
from measured_trials import table
from synthetic_walks import FIRST_SEED

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "cohort-speed.md"
PEOPLE, FEWER = 200, 50
WALK_S = 2.5
ALLOWED = 1.15
DATA_SET_PEOPLE, DATA_SET_FRAMES = 273, 24_000_000
SECONDS_PER_FRAME, PAGE = 4.24e-3, "long-trials.md"
"""Of ten minutes of gait, as that page has them: a person of the data set has a quarter of an hour."""
_LOOK_S = 0.5


@dataclass(frozen=True)
class Run:
    """A cohort.

    Attributes:
        people: how many were fitted.
        wall_s: from the start of the command to its end.
        most_mb: most memory of all its processes together.
        late_mb: the same while the second half of the people was fitted, and the tables were written.
    """

    people: int
    wall_s: float
    most_mb: float
    late_mb: float


def write_people(folder: Path, count: int) -> Path:
    """Synthetic people as files, in a folder each."""
    subject = walking_subject()
    prior = literature_prior(subject.literature)
    for number in range(count):
        rng = np.random.default_rng([FIRST_SEED, number])
        person = replace(subject, bsp=prior.draw(rng))
        write_lab(folder / f"P{number:03d}", record(person, walk(person, WALK_S), LabNoise(), rng))
    return folder


def single_fits(study: Path, out: Path) -> list[float]:
    """Seconds of each person in this process, results and rows of the tables included."""
    prepare_folder(out)
    seconds = []
    for number, one in enumerate(standings(people_of(study, out), out)):
        job = Job.of(one, out)
        if number == 0:
            fit_person(job)  # what is loaded and compiled once
        began = time.perf_counter()
        record = fit_person(job)
        seconds.append(time.perf_counter() - began)
        assert record.fitted, record.sentence
    return seconds


def cohort(study: Path, out: Path, people: int) -> Run:
    """The command."""
    command = [sys.executable, "-c", "from kinertia.cli.start import main; main()", "cohort", str(study)]
    began, looks = time.perf_counter(), []
    with subprocess.Popen([*command, "-o", str(out), "--quiet"]) as process:
        watched = threading.Thread(target=_watch, args=(process.pid, out, looks))
        watched.start()
        process.wait()
        wall_s = time.perf_counter() - began
        watched.join()
    assert process.returncode in (0, 1), process.returncode
    late = [megabytes for done, megabytes in looks if done >= people // 2]
    return Run(people, wall_s, max(megabytes for _, megabytes in looks), max(late))


def _watch(pid: int, out: Path, looks: list[tuple[int, float]]) -> None:
    """People finished, and memory, until the process ends."""
    try:
        process = psutil.Process(pid)
        while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
            done = sum(1 for _ in (out / "people").glob("*/person.json")) if out.is_dir() else 0
            looks.append((done, sum(map(_own_mb, [process, *process.children(recursive=True)]))))
            time.sleep(_LOOK_S)
    except psutil.NoSuchProcess:
        pass


def _own_mb(process: psutil.Process) -> float:
    try:
        return process.memory_info().rss / 1e6
    except psutil.NoSuchProcess:
        return 0.0


def document(singles: list[float], runs: list[Run], workers: int) -> str:
    """The text of the page."""
    fewer, all_of_them = runs
    ideal_s = sum(singles) / workers
    ratio = all_of_them.wall_s / ideal_s
    rows = [
        [
            str(run.people),
            f"{run.wall_s:.0f}",
            f"{run.wall_s / run.people:.2f}",
            f"{run.most_mb:.0f}",
            f"{run.late_mb:.0f}",
        ]
        for run in runs
    ]
    headings = ["people", "seconds", "seconds per person", "most memory (MB)", "second half (MB)"]
    per_person_s = sum(singles) / len(singles)
    frames_h, people_h = DATA_SET_FRAMES * SECONDS_PER_FRAME / 3600.0, DATA_SET_PEOPLE * per_person_s / 3600.0
    total_h = ratio * (frames_h + people_h)
    listed = ", ".join(f"{total_h / cores:.1f} h on {cores} cores" for cores in sorted({2, workers, 64}))
    return f"""# Speed of cohorts

{len(singles)} synthetic people, {WALK_S:g} s of gait each (markers and plates at 100 Hz), as files; {workers} processes
on {os.cpu_count()} cores. This page is written by `python benchmarks/cohort.py`; do not edit it by hand.

{table(headings, rows)}

- Single fits one after the other take {sum(singles):.0f} s, {per_person_s:.2f} s each, results included; divided by
  {workers}: {ideal_s:.0f} s. The cohort, tables and page included, takes {ratio:.2f} times that
  ({"within" if ratio <= ALLOWED else "more than"} {ALLOWED:g}).
- From {fewer.people} to {all_of_them.people} people the most memory of all processes together goes from
  {fewer.most_mb:.0f} to {all_of_them.most_mb:.0f} MB.

## {DATA_SET_FRAMES // 1_000_000} million frames

The largest public data set has {DATA_SET_PEOPLE} people and {DATA_SET_FRAMES // 1_000_000} million frames,
{DATA_SET_FRAMES // DATA_SET_PEOPLE} of each. At {1e3 * SECONDS_PER_FRAME:.2f} ms a frame ([long trials]({PAGE}), ten
minutes) the frames take {frames_h:.1f} h of one core, what each person costs besides {people_h:.1f} h, and both
{ratio:.2f} times as long in a cohort: {listed}. This is arithmetic; nobody has run it.
"""


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--people", type=int, default=PEOPLE)
    parser.add_argument("--fewer", type=int, default=FEWER)
    parser.add_argument("--dry-run", action="store_true", help="print the page, and write none")
    parser.add_argument("--alone", help="study: its single fits in this process, as JSON")
    given = parser.parse_args()
    if given.alone:
        with tempfile.TemporaryDirectory() as folder:
            print(json.dumps(single_fits(Path(given.alone), Path(folder) / "out")))
        return
    with tempfile.TemporaryDirectory() as folder:
        studies = [write_people(Path(folder) / f"study{count}", count) for count in (given.fewer, given.people)]
        alone = [sys.executable, __file__, "--alone", str(studies[1])]
        singles = json.loads(subprocess.run(alone, check=True, stdout=subprocess.PIPE).stdout)
        counts = (given.fewer, given.people)
        runs = [cohort(study, study.with_suffix(".out"), count) for study, count in zip(studies, counts, strict=True)]
        text = document(singles, runs, local_size(given.people).workers)
    print(json.dumps([asdict(run) for run in runs]), file=sys.stderr)
    print(text)
    if not given.dry_run:
        DOCUMENT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
