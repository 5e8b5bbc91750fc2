"""The folder of an earlier run."""

import pytest

from result_files import write


@pytest.fixture
def results(tmp_path):
    """Results of an earlier run."""
    write(tmp_path / "out", "old", "a.txt", "b.txt", "walk/c.txt")
    return tmp_path / "out"
