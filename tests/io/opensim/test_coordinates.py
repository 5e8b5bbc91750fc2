"""What a model's file says of its coordinates: ranges, locks, couplings."""

from typing import NamedTuple

import numpy as np
import pytest

from kinertia.io.opensim.reader import read_osim
from osim_comparison import RAJAGOPAL, random_states
from osim_text import LINEAR, coordinate, coupler, custom_root, joint, model
from recordings import here

WRITTEN = "written here"


class Facts(NamedTuple):
    """Coordinates in the file and of the skeleton; the range of one, the default of the height above ground, locked
    ones with their places, followers with their leaders; what else is in the file.
    """

    count: int
    free: int
    ranges: dict[str, tuple[float, float]]
    height: dict[str, float]
    locked: dict[str, float]
    couplings: dict[str, str]
    root: tuple[str, ...]
    mass_kg: float
    markers: int


FACTS = {
    WRITTEN: Facts(
        9, 7, {"bend": (0.0, 2.0944)}, {"ty": 0.94}, {"twist": 0.4}, {"follow": "bend"},
        ("tx", "ty", "tz", "tilt", "list", "turn"), 13.0, 5,
    ),
    RAJAGOPAL: Facts(
        39, 29, {"knee_angle_r": (0.0, 2.0944)}, {"pelvis_ty": 0.94}, {"mtp_angle_r": 0.0},
        {f"knee_angle_{side}_beta": f"knee_angle_{side}" for side in "rl"},
        tuple(f"pelvis_{name}" for name in ("tx", "ty", "tz", "tilt", "list", "rotation")), 85.0668, 41,
    ),
}  # fmt: skip


@pytest.fixture
def path_of(file_of, tmp_path):
    """Path of one of the files; the small one is written."""

    def path(name):
        if name != WRITTEN:
            return file_of(name)
        gimbal = joint("GimbalJoint", "between", "/bodyset/pelvis", "leg", ("bend", "twist", "follow"))
        text = model(custom_root() + gimbal, coupler(LINEAR, "follow", "bend"))
        held = "<default_value>0.4</default_value><locked>true</locked>"
        for before, after in (
            (coordinate("bend"), coordinate("bend").replace("-3 3", "0 2.0944")),
            (coordinate("twist"), coordinate("twist", held)),
            (coordinate("ty"), coordinate("ty", "<default_value>0.94</default_value>")),
        ):
            assert text.count(before) == 1
            text = text.replace(before, after)
        (tmp_path / "small.osim").write_text(text)
        return tmp_path / "small.osim"

    return path


FILES = [WRITTEN, *here([RAJAGOPAL])]


@pytest.mark.parametrize("name", FILES)
def test_coordinates_ranges_locks_and_couplings(path_of, name):
    ours, facts = read_osim(path_of(name)), FACTS[name]
    by_name = {c.name: c for c in ours.coordinates}
    assert len(by_name) == facts.count
    assert {listed: by_name[listed].range for listed in facts.ranges} == facts.ranges
    assert all(by_name[listed].locked for listed in facts.locked)
    assert facts.locked.items() <= dict(ours.skeleton.locked).items()
    assert {listed: by_name[listed].default for listed in facts.height} == facts.height
    assert {c.dependent: c.independent for c in ours.couplings} == facts.couplings
    assert len(ours.skeleton.coordinates) == facts.free
    assert ours.skeleton.coordinates[:6] == facts.root
    assert ours.bsp.total_mass_kg == pytest.approx(facts.mass_kg)
    assert len(ours.skeleton.markers) == facts.markers


@pytest.mark.parametrize("name", FILES)
def test_all_coordinates_of_the_file_are_given_back(path_of, name):
    ours, facts = read_osim(path_of(name)), FACTS[name]
    q = random_states(ours, 4, 1.0).q
    every = ours.all_coordinates(ours.skeleton, q)
    column = [c.name for c in ours.coordinates].index
    assert every.shape == (4, facts.count)
    for follower, leader in facts.couplings.items():
        np.testing.assert_array_equal(every[:, column(follower)], q[:, ours.skeleton.coordinates.index(leader)])
    for held, place in facts.locked.items():
        np.testing.assert_array_equal(every[:, column(held)], place)
