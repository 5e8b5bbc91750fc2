"""Work in two threads gives what it gives in one, errors included."""

import subprocess
import sys
import threading

import numpy as np
import pytest

from kinertia.motion import workload
from kinertia.motion.workload import both, side_by_side


@pytest.fixture(params=[1, 2])
def cores(request, monkeypatch):
    monkeypatch.setattr(workload, "cores", lambda: request.param)
    return request.param


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_results_keep_the_order_of_the_items(cores, count):
    assert side_by_side(lambda value: value**2, list(range(count))) == [k**2 for k in range(count)]


def test_there_are_two_threads_and_no_third(monkeypatch):
    monkeypatch.setattr(workload, "cores", lambda: 2)
    meeting = threading.Barrier(2, timeout=20)

    def within(_: int) -> int:
        return threading.get_ident()

    def outer(_: int) -> list[int]:
        meeting.wait()
        threads = [threading.get_ident(), *side_by_side(within, [0, 1])]
        meeting.wait()
        return threads

    first, second = side_by_side(outer, [0, 1])
    assert len(set(first)) == len(set(second)) == 1
    assert first[0] != second[0]


@pytest.mark.parametrize("failing", [0, 1])
def test_an_error_comes_through_and_leaves_nothing_held(cores, failing):
    def function(item: int) -> int:
        if item == failing:
            raise np.linalg.LinAlgError("not positive definite")
        return item

    with pytest.raises(np.linalg.LinAlgError):
        side_by_side(function, [0, 1])
    assert side_by_side(abs, [-1, 2]) == [1, 2]


def test_an_interruption_does_not_wait_for_the_second_thread(monkeypatch):
    monkeypatch.setattr(workload, "cores", lambda: 2)
    begun, go_on, ended = threading.Event(), threading.Event(), threading.Event()

    def interrupted() -> None:
        begun.wait(timeout=20)
        raise KeyboardInterrupt

    def long() -> None:
        begun.set()
        go_on.wait(timeout=20)
        ended.set()

    with pytest.raises(KeyboardInterrupt):
        both(interrupted, long)
    assert not ended.is_set()
    go_on.set()
    assert ended.wait(timeout=20)


def test_numpy_is_as_forgiving_in_the_second_thread(cores):
    with np.errstate(all="raise"), pytest.raises(FloatingPointError):
        side_by_side(lambda value: np.float64(1.0) / value, [np.float64(1.0), np.float64(0.0)])


def test_a_process_among_others_stays_in_one_thread():
    program = (
        "import threading\nfrom kinertia.motion import workload as two\ntwo.cores = lambda: 2\n"
        "two.in_one_thread()\nprint(len(set(two.side_by_side(lambda _: threading.get_ident(), [0, 1]))))"
    )
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout.strip() == "1"
