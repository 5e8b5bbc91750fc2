"""A short synthetic walk, and its estimate without any error of instruments."""

import pytest

from kinertia.synthetic.walk import walk, walking_subject
from short_walk_fit import fitted


@pytest.fixture(scope="session")
def trial():
    return walk(walking_subject(), 0.9, trapezoid=False)


@pytest.fixture(scope="session")
def plain(trial):
    return fitted(trial)
