from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.interpolate import BSpline

from kinertia.errors import FileError
from kinertia.io.object_archive import read_archive, write_archive


@dataclass(frozen=True, eq=False)
class Leaf:
    values: np.ndarray
    spline: BSpline | None = None


class Pair(NamedTuple):
    first: Any
    second: Any


@dataclass(frozen=True, eq=False)
class Tree:
    leaves: tuple[Leaf, ...]
    by_name: Mapping[str, Any]


KINDS = (Leaf, Tree, Pair)


def there_and_back(thing, tmp_path):
    path = tmp_path / "x.npz"
    write_archive(path, thing, KINDS, {"program": "test"})
    return read_archive(path, KINDS), path


FOLDER = None


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory):
    global FOLDER
    FOLDER = tmp_path_factory.mktemp("archives")


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.tuples(inner, inner)
        | st.dictionaries(st.text(max_size=3), inner, max_size=3)
        | st.builds(Pair, inner, inner)
    ),
    max_leaves=5,
)


@settings(max_examples=40)
@given(PLAIN)
def test_plain_things_come_back_as_they_were(thing):
    assert repr(there_and_back(thing, FOLDER)[0]) == repr(thing)


@given(
    arrays.arrays(
        st.sampled_from(["f8", "f4", "i8", "u1", "?", "c16", "<U3"]),
        arrays.array_shapes(min_dims=0, max_dims=3, min_side=0),
    )
)
def test_arrays_come_back_bit_by_bit(values):
    (back,) = there_and_back((values,), FOLDER)[0]
    assert back.dtype == values.dtype
    assert back.shape == values.shape
    assert back.tobytes() == values.tobytes()


def test_a_tree_with_shared_parts(tmp_path):
    values = np.arange(6.0).reshape(2, 3)[:, ::2]
    spline = BSpline(np.arange(10.0), np.random.default_rng(0).normal(size=(6, 2)), 3, extrapolate=False)
    leaf = Leaf(values, spline)
    tree = Tree((leaf, leaf, Leaf(values)), {"a": np.float64(0.1), "again": leaf, "where": Path("b") / "c"})
    back, path = there_and_back(tree, tmp_path)
    assert back.leaves[0] is back.leaves[1] is back.by_name["again"]
    assert back.leaves[2].values is back.leaves[0].values
    assert back.by_name["a"] == 0.1
    assert back.by_name["where"] == Path("b") / "c"
    at = np.linspace(3, 6, 20)
    np.testing.assert_array_equal(back.leaves[0].spline(at, 1), spline(at, 1))
    with np.load(path) as plain:  # NumPy alone reads it
        np.testing.assert_array_equal(plain["leaves.0.values"], values)
        assert b'"program": "test"' in plain["structure.json"]


def test_what_it_does_not_know_is_refused(tmp_path):
    with pytest.raises(TypeError, match=r"leaves\.0: a object cannot be written"):
        write_archive(tmp_path / "x.npz", Tree((object(),), {}), KINDS, {})
    with pytest.raises(ValueError, match="pickle"):
        write_archive(tmp_path / "x.npz", Leaf(np.array([object()])), KINDS, {})


def test_damaged_and_foreign_files_are_told(tmp_path):
    _, path = there_and_back(Leaf(np.arange(1000.0)), tmp_path)
    whole = path.read_bytes()
    for cut in (0, 10, len(whole) // 2, len(whole) - 5):
        path.write_bytes(whole[:cut])
        with pytest.raises(FileError, match=r"x\.npz: is damaged or .* run the fit again"):
            read_archive(path, KINDS)
    path.write_bytes(whole)
    with pytest.raises(FileError, match="KeyError: 'Leaf'"):
        read_archive(path, (Tree,))
    np.savez(path, values=np.arange(3))
    with pytest.raises(FileError, match="damaged"):
        read_archive(path, KINDS)
    with pytest.raises(FileError, match="cannot be read"):
        read_archive(tmp_path / "none.npz", KINDS)
