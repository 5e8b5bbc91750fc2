"""How long a cohort takes is guessed from the frames of its people."""

from types import SimpleNamespace

import pytest

from kinertia.cohort.job import guessed_seconds


def people(*frames):
    return [SimpleNamespace(frames=frame) for frame in frames]


def test_a_cohort_takes_no_less_than_its_longest_fit():
    longest = guessed_seconds(people(100_000), 1)
    assert longest > 10.0 * guessed_seconds(people(100), 1)
    assert guessed_seconds(people(100_000, 100, 100), 3) == pytest.approx(longest)


def test_work_is_shared_out_among_workers():
    assert guessed_seconds(people(500, 500, 500, 500), 2) == pytest.approx(guessed_seconds(people(500, 500), 1))
    assert guessed_seconds([], 2) == 0.0
