"""Studies in the process of the test: starting others takes longer than short studies do."""

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from unittest import mock


class _Here:
    """In place of a `ProcessPoolExecutor`: every task is done when it is submitted."""

    def __init__(self, workers, mp_context, initializer):
        pass

    def submit(self, task, case):
        future: Future = Future()
        try:
            future.set_result(task(case))
        except Exception as error:
            future.set_exception(error)
        return future

    def shutdown(self, cancel_futures):
        pass


@contextmanager
def in_one_process() -> Iterator[None]:
    """As a context, or as a decorator of a test."""
    with mock.patch("kinertia.studies.parallel.ProcessPoolExecutor", _Here):
        yield
