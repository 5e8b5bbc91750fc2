"""SLURM's commands as a laboratory's login node has them, without SLURM: jobs that end at once, are refused, or run.

`fake_slurm` writes `sbatch`, `squeue` and `scancel` into a folder. `sbatch` looks into the file `answers` there for
what becomes of each job in turn: `ends` (SLURM takes it, and its worker never reports), `refused` or `runs`. The last
line stands for all further ones.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

REFUSAL = "sbatch: error: invalid partition specified: long"
LAST_WORDS = "/shared/venv/bin/python: No module named distributed"


def fake_slurm(folder: Path, answers: list[str]) -> Path:
    """The folder, to be the first on the path."""
    folder.mkdir()
    (folder / "answers").write_text("\n".join(answers), encoding="utf-8")
    for name in ("sbatch", "squeue", "scancel"):
        program = folder / name
        program.write_text(
            f'#!/bin/sh\nexec "{sys.executable}" "{__file__}" "{folder}" {name} "$@"\n', encoding="utf-8"
        )
        program.chmod(0o755)
    return folder


def _sbatch(folder: Path, script: Path) -> None:
    answers = (folder / "answers").read_text(encoding="utf-8").split("\n")
    number = _number(folder)
    answer = answers[min(number, len(answers)) - 1]
    if answer == "refused":
        sys.exit(REFUSAL)
    text = script.read_text(encoding="utf-8")
    pid = ""
    if answer == "runs":
        (folder / f"{number}.sh").write_text(text, encoding="utf-8")
        process = subprocess.Popen(
            ["sh", str(folder / f"{number}.sh")],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        pid = str(process.pid)
    else:
        errors = [line.removeprefix("#SBATCH -e ") for line in text.splitlines() if line.startswith("#SBATCH -e ")]
        for path in errors:
            Path(path.replace("%J", str(number))).write_text(f"{LAST_WORDS}\n", encoding="utf-8")
    (folder / f"{number}.job").write_text(pid, encoding="utf-8")
    print(f"Submitted batch job {number}")


def _number(folder: Path) -> int:
    """The next one, its file made; jobs are submitted side by side."""
    number = 1
    while True:
        try:
            (folder / f"{number}.job").touch(exist_ok=False)
        except FileExistsError:
            number += 1
        else:
            return number


def _squeue(folder: Path) -> None:
    for path in folder.glob("*.job"):
        pid = path.read_text(encoding="utf-8")
        if pid and Path(f"/proc/{pid}").exists():
            print(path.stem)


def _scancel(folder: Path, job: str) -> None:
    pid = (folder / f"{job}.job").read_text(encoding="utf-8")
    if pid:
        os.killpg(int(pid), signal.SIGKILL)


if __name__ == "__main__":
    place, command, *rest = sys.argv[1:]
    if command == "sbatch":
        _sbatch(Path(place), Path(rest[0]))
    elif command == "squeue":
        _squeue(Path(place))
    else:
        _scancel(Path(place), rest[0])
