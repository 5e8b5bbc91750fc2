"""Work in processes of its own."""

import multiprocessing
import os
import signal
import sys

import pytest

from kinertia.studies.parallel import in_parallel, process_count
from one_process import in_one_process


def test_results_are_in_the_order_of_the_cases_and_no_process_is_left():
    shares = []
    assert in_parallel(abs, [-3, 1, -2], workers=2, progress=shares.append) == [3, 1, 2]
    assert shares == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert not multiprocessing.active_children()


def test_tests_can_have_studies_in_their_own_process():
    shares = []
    with in_one_process():
        assert in_parallel(lambda case: (case, os.getpid()), "ab", progress=shares.append) == [
            ("a", os.getpid()),
            ("b", os.getpid()),
        ]
        with pytest.raises(ZeroDivisionError):
            in_parallel(lambda case: 1 / case, [1, 0])
    assert shares == [0.0, 0.5, 1.0]


@pytest.mark.parametrize(
    ("system", "cores", "wanted", "cases", "count"),
    [
        ("linux", 128, None, 100, 100),
        ("linux", 4, None, 100, 4),
        ("linux", 4, 9, 100, 9),
        ("linux", 4, None, 0, 1),
        ("win32", 128, None, 100, 61),  # concurrent.futures refuses more there
        ("win32", 4, 99, 100, 61),
        ("win32", 4, None, 100, 4),
    ],
)
def test_number_of_processes(monkeypatch, system, cores, wanted, cases, count):
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    assert process_count(wanted, cases) == count


def test_an_interruption_waits_until_the_processes_have_started(monkeypatch):
    started = []

    def submit(self, task, case):
        signal.raise_signal(signal.SIGINT)
        started.append(case)

    monkeypatch.setattr("kinertia.studies.parallel.ProcessPoolExecutor.submit", submit)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            in_parallel(abs, [1, 2])
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, handler)
    assert started == [1, 2]
