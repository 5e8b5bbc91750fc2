"""A cohort whose command is killed at random moments, and one whose disk is full: a process of its own.

    python tests/cohort_kills.py FOLDER KILLS SEED
    unshare -rm python tests/cohort_kills.py FOLDER KILLS SEED

Everything is loaded once, and the fits, which write nothing, are made once; every run is a fork of this process, which
also fits: what `kill -9` ends is all of it. The clock that computing is measured with stands
still, so that all bytes can be compared. Prints how many kills fell before the end of a run, how many of them after a
person was finished, and what a run said whose disk was full: that takes the right to mount, which `unshare` gives.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from unittest import mock

from cohort_faults import write_study
from command_line import run
from kinertia.cohort.job import LOG, Finished, Job, measured
from kinertia.cohort.worker import fit_person
from kinertia.estimation.result.fit import Fit
from kinertia.io.subject.tables import SubjectFile
from kinertia.workflow.from_files import fit_subject

NAMES = ("Anna", "Ben")


def in_this_process(jobs: Sequence[Job], size: object) -> Iterator[Finished]:
    for job in jobs:
        yield measured(fit_person, job)


def forked(work: Callable[[], int]) -> int:
    child = os.fork()
    if not child:
        status = 70
        try:
            status = work()
        finally:
            os._exit(status)
    return child


def ended(child: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def files(folder: Path) -> dict[str, bytes]:
    """All but the log, which tells of every run."""
    kept = (path for path in folder.rglob("*") if path.is_file() and path.name != LOG)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in kept}


def made_once(study: Path) -> Callable[[SubjectFile], Fit]:
    fits = {fit.subject.name: fit for fit in (fit_subject(study / name / "subject.toml") for name in NAMES)}
    return lambda wanted: fits[wanted.subject.name]


def of_person(found: dict[str, bytes], person: str) -> dict[str, bytes]:
    return {name: content for name, content in found.items() if name.startswith(f"people/{person}/")}


def cohort(study: Path, out: Path, words: Path | None = None) -> int:
    """Status of a run; what it said goes to a file, with the number of times that it touched the disk."""
    touches = counted_touches()
    outcome = run("cohort", study, "-o", out)
    if words is not None:
        words.write_text(f"{outcome.out}{outcome.err}{len(touches)}\n", encoding="utf-8")
    return outcome.status


def killed_at(moment: int, study: Path, out: Path) -> int:
    """The same, killed when it is about to touch the disk once more than `moment` times."""
    counted_touches(moment)
    return cohort(study, out)


def counted_touches(moment: int | None = None) -> list[str]:
    touches: list[str] = []

    def touch(event: str, arguments: object) -> None:
        if event.startswith(("open", "os.", "shutil.")):
            touches.append(event)
            if len(touches) - 1 == moment:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(touch)
    return touches


def may_mount() -> bool:
    return os.getpid() > 0 and subprocess.run(["unshare", "-m", "true"], capture_output=True).returncode == 0


def disks_kb(calm: dict[str, bytes]) -> tuple[int, int, int]:
    """Sizes of disks that are too small for anybody, for everybody, and for the tables."""
    sizes_kb = {name: -(-len(content) // 1024) for name, content in calm.items()}
    person = sum(size for name, size in sizes_kb.items() if name.startswith(f"people/{NAMES[0]}/"))
    tables = sum(size for name, size in sizes_kb.items() if not name.startswith("people/"))
    return 200, person + tables + 400, 2 * person + 400


def with_full_disk(study: Path, out: Path, calm: dict[str, bytes], size_kb: int) -> tuple[int, str]:
    """Status and words of a run on a disk of this size; people on it are whole, and with more space all is finished."""
    disk, words = str(out.parent), study.with_suffix(".txt")
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "none", disk], check=True)
    status = ended(forked(lambda: cohort(study, out, words)))
    for name in {path.name for path in (out / "people").glob("*")} & {*NAMES}:
        assert of_person(files(out), name) == of_person(calm, name), name
    subprocess.run(["mount", "-o", "remount,size=100m", disk], check=True)
    assert ended(forked(lambda: cohort(study, out))) in (0, 1)
    assert files(out) == calm
    subprocess.run(["umount", disk], check=True)
    return status, words.read_text(encoding="utf-8")


def main() -> None:
    folder, kills, rng = Path(sys.argv[1]), int(sys.argv[2]), random.Random(sys.argv[3])
    study, out = write_study(folder / "study", NAMES), folder / "disk" / "out"
    out.parent.mkdir()
    with (
        mock.patch("time.perf_counter", float),
        mock.patch("kinertia.cli.cohort.fit_here", in_this_process),
        mock.patch("kinertia.cohort.worker.fit_subject", made_once(study)),
    ):
        counted = study.with_suffix(".txt")
        assert ended(forked(lambda: cohort(study, out, counted))) in (0, 1)
        one_run = int(counted.read_text(encoding="utf-8").splitlines()[-1])
        calm = files(out)
        shutil.rmtree(out)
        early = with_people = 0
        for _ in range(kills):
            killed = ended(forked(partial(killed_at, rng.randrange(one_run), study, out))) == -signal.SIGKILL
            early += killed
            found = files(out) if out.exists() else {}
            done = {name.split("/")[1] for name in found if name.startswith("people/")} & {*NAMES}
            with_people += killed and bool(done)
            for name in done:
                assert of_person(found, name) == of_person(calm, name), name
            if not killed:
                assert found == calm
                shutil.rmtree(out)
        assert ended(forked(lambda: cohort(study, out))) in (0, 1)
        last = files(out)
        assert last == calm, [name for name in last.keys() | calm.keys() if last.get(name) != calm.get(name)]
        said = [with_full_disk(study, out, calm, size_kb) for size_kb in disks_kb(calm)] if may_mount() else []
    print(json.dumps([early, with_people, *said]))


if __name__ == "__main__":
    main()
