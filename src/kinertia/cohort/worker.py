"""Fits one person of a cohort after another, as its standard input asks: `python -m kinertia.cohort.worker`.

Each line is a `Job`; the answer is a line of JSON, what `Finished` holds. It ends with its input, even during a fit,
since the command that started it is then gone.
"""

import os
import sys
from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread
from typing import TextIO

from kinertia.cohort.job import Job, measured
from kinertia.cohort.person import fit_person
from kinertia.cohort.record import Record
from kinertia.studies.parallel import one_thread


def main(fit: Callable[[Job], Record] = fit_person) -> None:
    """Answer until the input ends."""
    answers, sys.stdout = sys.stdout, sys.stderr  # keeps other output off the answers
    one_thread()
    lines: SimpleQueue[str] = SimpleQueue()
    Thread(target=_listen, args=(sys.stdin, lines), daemon=True).start()
    while True:
        answers.write(measured(fit, Job.of_text(lines.get())).text + "\n")
        answers.flush()


def _listen(asked: TextIO, lines: SimpleQueue[str]) -> None:
    for line in asked:
        lines.put(line)
    os._exit(0)


if __name__ == "__main__":
    main()
