"""A person's lengths are taken for metres only where they can be."""

from dataclasses import replace

import numpy as np
import pytest

import upright_model as upright
from kinertia.diagnostics.model.geometry import length_unit
from kinertia.io.opensim.reader import read_osim
from kinertia.model.skeleton import Marker, Skeleton
from people import with_model
from sound_models import MODELS


def found(skeleton: Skeleton, bsp=None) -> list[tuple[str, str, float]]:
    """Code, what is too far apart, and by how much (m)."""
    context = with_model(skeleton, upright.bsp() if bsp is None else bsp)
    return [
        (finding.code, finding.evidence["what"].value, finding.evidence["length_m"].value)
        for finding in length_unit(context)
    ]


def as_large(factor: float) -> Skeleton:
    """The upright model with all its joints this many times as far apart."""
    skeleton = upright.skeleton()
    joints = tuple(replace(joint, translation=factor * np.asarray(joint.translation)) for joint in skeleton.joints)
    return replace(skeleton, joints=joints)


@pytest.mark.parametrize("factor", [0.3, 1.0, 1.3])
def test_children_and_giants_pass(factor):
    assert found(as_large(factor)) == []


@pytest.mark.parametrize(
    ("factor", "words", "length_m"),
    [
        (1000.0, "The distance between the joints of body", 500.0),
        (100.0, "The distance between the joints of body", 50.0),
        (3.28, "The largest distance between two joints", 4.0),  # feet
        (0.001, "The largest distance between two joints", 0.001),
    ],
)
def test_other_units(factor, words, length_m):
    ((code, what, found_m),) = found(as_large(factor))
    assert (code, what.startswith(words)) == ("O301", True)
    assert found_m == pytest.approx(length_m, rel=0.6)


def test_one_marker_in_millimetres():
    skeleton = replace(upright.skeleton(), markers=(Marker("R.Thigh", "femur_r", np.array([50.0, -100.0, 70.0])),))
    ((_, what, length_m),) = found(skeleton)
    assert "marker R.Thigh" in what
    assert "femur_r" in what
    assert length_m == pytest.approx(132.0, abs=1.0)


def test_a_marker_at_the_end_of_a_barbell():
    skeleton = replace(upright.skeleton(), markers=(Marker("Bar", "hand_r", np.array([0.0, 0.0, 1.1])),))
    assert found(skeleton) == []


@pytest.mark.parametrize("name", MODELS)
def test_models_in_use(file_of, name):
    model = read_osim(file_of(name))
    assert found(model.skeleton, model.bsp) == []
