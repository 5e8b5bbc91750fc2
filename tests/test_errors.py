"""Errors come back from other processes with their message and their data."""

import pickle

import pytest

from kinertia.errors import (
    BlockedError,
    FileError,
    KinertiaError,
    MarkerSetError,
    OsimError,
    PriorError,
    SessionError,
    SettingsError,
    SubjectError,
    TrialError,
)
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity

TWICE = finding("F173", names=Quantity("one, one"), problem=Quantity("each needs a name"))
ERRORS = [
    KinertiaError("in words"),
    FileError("walk.trc", "is empty", 3),
    MarkerSetError("no set fits", ["RASI"], {"RASI": ["R.ASIS"]}),
    TrialError("walk", "has no forces"),
    SubjectError("mass_kg", -3.0, "is negative"),
    PriorError("cannot be", "thigh_r.mass"),
    SettingsError("cutoff"),
    SessionError("plates"),
    OsimError("model.osim", "has no bodies"),
    FileError.found("walk.trc", "F104", 3, found=Quantity("it is empty")),
    BlockedError([TWICE], [TWICE]),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors_come_back_from_other_processes(error):
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error)
    assert str(back) == str(error)
    assert vars(back) == vars(error)


def test_what_blocks_names_its_file_and_line():
    unread = FileError.found("walk.trc", "F104", 3, found=Quantity("it is empty")).finding.in_trial("walk")
    lines = str(BlockedError([], [unread, TWICE])).split("\n")
    assert lines[0].startswith("walk.trc, line 3  F104 ")
    assert lines[1].startswith(TWICE.line())


def test_every_kind_is_tried():
    def kinds(above):
        return {above, *(kind for below in above.__subclasses__() for kind in kinds(below))}

    of_package = {kind for kind in kinds(KinertiaError) if kind.__module__ == "kinertia.errors"}
    assert {type(error) for error in ERRORS} == of_package
