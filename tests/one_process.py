"""Studies in the process of the test: starting others takes longer than short studies do."""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock


def _one_by_one(task, cases, workers=None, progress=lambda share: None):
    """In place of `in_parallel`."""
    progress(0.0)
    results = []
    for case in cases:
        results.append(task(case))
        progress(len(results) / len(cases))
    return results


@contextmanager
def in_one_process() -> Iterator[None]:
    """As a context, or as a decorator of a test."""
    with (
        mock.patch("validation.accuracy_study.in_parallel", _one_by_one),
        mock.patch("kinertia.studies.table1.in_parallel", _one_by_one),
        mock.patch("kinertia.studies.table1_variants.in_parallel", _one_by_one),
    ):
        yield
