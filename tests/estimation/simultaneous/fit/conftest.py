"""A short synthetic walk, and its estimate without any error of instruments."""

import pytest

from kinertia.synthetic.walk import walk, walking_subject
from once import once
from short_walk_fit import fitted


@pytest.fixture(scope="session")
def trial():
    return walk(walking_subject(), 0.9, trapezoid=False)


@pytest.fixture(scope="session")
def plain(tmp_path_factory, trial):
    return once(tmp_path_factory, "short-walk-fit", lambda _: fitted(trial))
