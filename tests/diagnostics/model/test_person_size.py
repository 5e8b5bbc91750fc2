"""A person's lengths are taken for metres only where they can be."""

from dataclasses import replace

import numpy as np
import pytest

import upright_model as upright
from kinertia.diagnostics.model.person_size import size_trouble
from kinertia.io.osim.reader import read_osim
from kinertia.model.skeleton import Marker, Skeleton
from sound_models import MODELS


def as_large(factor: float) -> Skeleton:
    """The upright model with all its joints this many times as far apart."""
    skeleton = upright.skeleton()
    joints = tuple(replace(joint, translation=factor * np.asarray(joint.translation)) for joint in skeleton.joints)
    return replace(skeleton, joints=joints)


@pytest.mark.parametrize("factor", [0.3, 1.0, 1.3])
def test_children_and_giants_pass(factor):
    assert size_trouble(as_large(factor), upright.bsp()) == ""


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1000.0, "most likely mm or cm in place of m"),
        (100.0, "the distance of the joints of body"),
        (3.28, "the joints of the model are at most 4."),  # feet
        (0.001, "the joints of the model are at most 0.0014"),
    ],
)
def test_other_units(factor, words):
    assert words in size_trouble(as_large(factor), upright.bsp())


def test_one_marker_in_millimetres():
    skeleton = replace(upright.skeleton(), markers=(Marker("R.Thigh", "femur_r", np.array([50.0, -100.0, 70.0])),))
    trouble = size_trouble(skeleton, upright.bsp())
    assert "the distance of marker 'R.Thigh' from the joints of its body 'femur_r' is 132 m" in trouble
    assert "more lengths" not in trouble


def test_a_marker_at_the_end_of_a_barbell():
    skeleton = replace(upright.skeleton(), markers=(Marker("Bar", "hand_r", np.array([0.0, 0.0, 1.1])),))
    assert size_trouble(skeleton, upright.bsp()) == ""


@pytest.mark.parametrize("name", MODELS)
def test_models_in_use(file_of, name):
    model = read_osim(file_of(name))
    assert size_trouble(model.skeleton, model.bsp) == ""
