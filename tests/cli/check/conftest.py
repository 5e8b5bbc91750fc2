"""The laboratory that tests of `kinertia check` spoil."""

import numpy as np
import pytest

from kinertia.synthetic.laboratory import LabNoise, record, write_lab
from kinertia.synthetic.walk import walk, walking_subject


@pytest.fixture(scope="module")
def recordings():
    subject = walking_subject()
    trial = walk(subject, 2.7, 1000.0, 0.75)
    return record(subject, trial, LabNoise(skin="none"), np.random.default_rng(3), 10)


@pytest.fixture
def lab(tmp_path, recordings):
    """A folder with subject.toml, static.trc, walk.trc, walk_grf.mot of a synthetic person."""
    write_lab(tmp_path / "lab", recordings)
    return tmp_path / "lab"
