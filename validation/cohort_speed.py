"""Measure what a cohort costs beside single fits.

What a cohort costs beside its single fits, and how memory grows with its people.

Some 20 minutes on two quiet cores; try it with --people 8 --fewer 4 --sample 4 --dry-run.

Synthetic people, each with a body drawn from the literature's prior, walk past two plates; their files are written as a
laboratory's. Single fits are those of a sample of the people, before, between and after the cohorts, in a process that
does what a worker does: one after the other, and in as many processes at once as the cohort has. The cohort is the
command, from its start to its end. Memory is that of all its processes together, looked at twice a second.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil
import typer

from kinertia.cohort.job import Job
from kinertia.cohort.local import local_size
from kinertia.cohort.people import people_of
from kinertia.cohort.record import prepare_folder, standings
from kinertia.cohort.worker import fit_person
from kinertia.estimation.prior import literature_prior
from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.walk import walk, walking_subject
from validation.measured_trials import table
from validation.page import PAGES, REPOSITORY, write_page
from validation.synthetic_walks import FIRST_SEED

PEOPLE, FEWER, SAMPLE = 200, 50, 20
WALK_S = 2.5
ALLOWED = 1.15
DATA_SET_PEOPLE, DATA_SET_FRAMES = 273, 24_000_000
PAGE = "long-trials.md"
_LOOK_S = 0.5


@dataclass(frozen=True)
class Run:
    """Time and memory of a cohort run.

    Attributes:
        people: number of people fitted.
        wall_s: time from the start of the command to its end.
        most_mb: peak memory of all its processes together.
        late_mb: the same while the second half of the people was fitted, and the tables were written.
    """

    people: int
    wall_s: float
    most_mb: float
    late_mb: float


def write_people(folder: Path, count: int) -> Path:
    """Write synthetic people as files, in a folder each."""
    subject = walking_subject()
    prior = literature_prior(subject.literature)
    for number in range(count):
        rng = np.random.default_rng([FIRST_SEED, number])
        person = replace(subject, bsp=prior.draw(rng))
        write_lab(folder / f"P{number:03d}", record(person, walk(person, WALK_S), LabNoise(), rng))
    return folder


@dataclass(frozen=True)
class Singles:
    """Seconds of single fits of the same people, including results and rows of the tables.

    Attributes:
        alone: fits one after the other.
        at_once: fits in as many parallel processes as a cohort has.
    """

    alone: list[float]
    at_once: list[float]


def fit_singly(study: Path, out: Path, numbers: list[int]) -> list[float]:
    """Return the seconds of fits of these people in this process."""
    prepare_folder(out)
    everybody = list(standings(people_of(study, out), out))
    fit_person(Job.of(everybody[numbers[0]], out))  # what is loaded and compiled once
    seconds = []
    for number in numbers:
        began = time.perf_counter()
        record = fit_person(Job.of(everybody[number], out))
        seconds.append(time.perf_counter() - began)
        assert record.fitted, record.sentence
    return seconds


def single_fits(study: Path, numbers: list[int], workers: int) -> Singles:
    """Time fits of these people, one after the other and in parallel, in separate processes."""
    parts = [part for part in (numbers[k::workers] for k in range(workers)) if part]
    return Singles(_in_processes(study, [numbers]), _in_processes(study, parts))


def _in_processes(study: Path, parts: list[list[int]]) -> list[float]:
    command = [sys.executable, "-m", __name__, str(study)]
    running = [subprocess.Popen([*command, *map(str, part)], cwd=REPOSITORY, stdout=subprocess.PIPE) for part in parts]
    outputs = [process.communicate()[0] for process in running]
    assert not any(process.returncode for process in running)
    return [seconds for output in outputs for seconds in json.loads(output)]


def cohort(study: Path, out: Path, people: int) -> Run:
    """Run and time the cohort command."""
    command = [sys.executable, "-c", "from kinertia.cli.start import main; main()", "cohort", str(study)]
    began, looks = time.perf_counter(), list[tuple[int, float]]()
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
    """Record the number of people finished, and memory, until the process ends."""
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


def seconds_per_frame() -> float:
    """Return seconds of one processor per frame for ten minutes of gait, from that page; a person of the data set has a
    quarter of an hour.
    """
    lines = (PAGES / PAGE).read_text(encoding="utf-8").splitlines()
    headings, row = (
        [cell.strip() for cell in next(line for line in lines if line.startswith(start)).strip("|").split("|")]
        for start in ("| walk |", "| 10 min |")
    )
    return 1e-3 * float(row[headings.index("processor (ms per frame)")])


def document(singles: Singles, runs: list[Run], workers: int) -> str:
    """Return the text of the page."""
    fewer, all_of_them = runs
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
    ideals, count = {}, all_of_them.people
    for name, seconds in (("alone", singles.alone), ("at once", singles.at_once)):
        each_s = sum(seconds) / len(seconds)
        ideals[name] = each_s, each_s * count / workers
    ratio, ratio_at_once = (all_of_them.wall_s / ideal_s for _, ideal_s in ideals.values())
    frame_s = seconds_per_frame()
    frames_h, people_h = DATA_SET_FRAMES * frame_s / 3600.0, DATA_SET_PEOPLE * ideals["alone"][0] / 3600.0
    total_h = ratio * (frames_h + people_h)
    listed = ", ".join(f"{total_h / cores:.1f} h on {cores} cores" for cores in sorted({2, workers, 64}))
    return f"""# Speed of cohorts

{fewer.people} and {all_of_them.people} synthetic people, {WALK_S:g} s of gait each (markers and plates at 100 Hz), as
files; {workers} processes on {os.cpu_count()} cores.

{table(headings, rows)}

- Single fits, results included, take {ideals["alone"][0]:.2f} s one after the other ({len(singles.alone)} people,
  before, between and after the cohorts). For {count} people, divided by {workers}: {ideals["alone"][1]:.0f} s. The
  cohort, tables and page included, takes {ratio:.2f} times that ({_judged(ratio)}).
- The same fits in {workers} processes side by side, which share the computer's memory and caches as a cohort's do, take
  {ideals["at once"][0]:.2f} s each. Of that the cohort takes {ratio_at_once:.2f} times ({_judged(ratio_at_once)}).
- From {fewer.people} to {all_of_them.people} people the most memory of all processes together goes from
  {fewer.most_mb:.0f} to {all_of_them.most_mb:.0f} MB.

## {DATA_SET_FRAMES // 1_000_000} million frames

The largest public data set has {DATA_SET_PEOPLE} people and {DATA_SET_FRAMES // 1_000_000} million frames,
{DATA_SET_FRAMES // DATA_SET_PEOPLE} of each. At {1e3 * frame_s:.2f} ms per frame ([long trials]({PAGE}), ten
minutes) the frames take {frames_h:.1f} h of one core, what each person costs besides {people_h:.1f} h, and both
{ratio:.2f} times as long in a cohort: {listed}. This is arithmetic; nobody has run it.
"""


def _judged(ratio: float) -> str:
    return f"{'within' if ratio <= ALLOWED else 'more than'} {ALLOWED:g}"


def main(
    people: Annotated[int, typer.Option(help="People of the larger cohort.")] = PEOPLE,
    fewer: Annotated[int, typer.Option(help="Of the smaller one.")] = FEWER,
    sample: Annotated[int, typer.Option(min=3, help="People whose single fits are timed.")] = SAMPLE,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the page, and write none.")] = False,
) -> None:
    """Measure and write the page."""
    with tempfile.TemporaryDirectory() as folder:
        few, study = (write_people(Path(folder) / f"study{count}", count) for count in (fewer, people))
        workers = local_size(people).workers
        spread = np.linspace(0, people - 1, sample).round().astype(int).tolist()
        rounds, runs = [single_fits(study, spread[::3], workers)], []
        for k, (study_folder, count) in enumerate(((few, fewer), (study, people)), start=1):
            runs.append(cohort(study_folder, study_folder.with_suffix(".out"), count))
            rounds.append(single_fits(study, spread[k::3], workers))
        singles = Singles(*([s for timed in rounds for s in getattr(timed, name)] for name in ("alone", "at_once")))
        text = document(singles, runs, workers)
    print(json.dumps({**asdict(singles), "runs": [asdict(run) for run in runs]}), file=sys.stderr)
    if dry_run:
        print(text)
    else:
        write_page("cohort-speed", text)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as results:
        _, people_folder, *people_numbers = sys.argv
        print(json.dumps(fit_singly(Path(people_folder), Path(results) / "out", list(map(int, people_numbers)))))
