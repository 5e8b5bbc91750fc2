"""Arrays in a temporary file."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from kinertia.errors import KinertiaError
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import KeptArrays

ARRAY = arrays.arrays(
    st.sampled_from([np.float64, np.float32]), arrays.array_shapes(max_dims=3, min_side=0, max_side=4)
)


@given(st.lists(st.lists(ARRAY, min_size=1, max_size=3), min_size=1, max_size=4), st.randoms())
def test_groups_come_back_in_any_order(groups, random):
    kept = KeptArrays()
    for group in groups:
        kept.add(*group)
    order = list(range(len(groups)))
    random.shuffle(order)
    for k in order:
        for found, expected in zip(kept.get(k), groups[k], strict=True):
            assert found.dtype == expected.dtype
            np.testing.assert_array_equal(found, expected)


def test_what_is_read_may_be_changed():
    kept = KeptArrays()
    kept.add(np.zeros(3))
    kept.get(0)[0][:] = 1.0
    assert not kept.get(0)[0].any()


def test_arrays_of_any_layout_are_kept():
    kept, array = KeptArrays(), np.arange(6.0).reshape(2, 3)
    kept.add(array.T)
    np.testing.assert_array_equal(kept.get(0)[0], array.T)


def test_without_room_the_folder_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone"))
    with pytest.raises(KinertiaError, match="gone"):
        KeptArrays().add(np.zeros(3))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_an_error_that_says_so(monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda: open("/dev/full", "wb"))  # noqa: SIM115
    with pytest.raises(KinertiaError, match="No space left"):
        KeptArrays().add(np.zeros(10_000))
