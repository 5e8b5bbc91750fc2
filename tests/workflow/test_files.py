"""A file is judged by what it is given as."""

import pytest

from kinertia.findings.finding import Severity
from kinertia.settings import Subject
from kinertia.workflow.check import check_person
from kinertia.workflow.files import RecordingFiles, read_files
from recordings import named_here

WALKS = named_here(
    {
        "synthetic": ("synthetic/walk.c3d", "synthetic/static.c3d"),
        "a": ("pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_a_static.c3d"),
        "b": ("pig_c3d/subject_b_walk.c3d", "pig_c3d/subject_b_static.c3d"),
    }
)
FAR_M = {"synthetic": 3.0, "a": 4.5, "b": 3.6}
"""How far they walk."""


@pytest.fixture(params=WALKS)
def given(request, file_of):
    """Name, and what is found of its files, where one of them may be given as the static trial."""

    def check(static=None):
        wanted = [RecordingFiles(file_of(one)) for one in WALKS[request.param]]
        chosen = None if static is None else wanted[static].markers
        return check_person(read_files(wanted, Subject(name="A"), static=chosen))

    return request.param, check


def test_who_stands_still_is_the_static_trial(given):
    name, check = given
    found = check()
    assert [one.context.is_static for one in found.recordings] == [True, False]
    assert [one.context.name for one in found.recordings] == [WALKS[name][k].split("/")[1][:-4] for k in (1, 0)]
    assert "S201" not in [one.code for one in found.findings]
    assert not [one for one in found.findings if one.severity is Severity.ERROR]


def test_a_walk_given_as_the_static_trial(given):
    name, check = given
    found = check(static=0)
    (walks,) = [one for one in found.findings if one.code == "S201"]
    assert walks.severity is Severity.WARNING
    assert walks.where.trial == WALKS[name][0].split("/")[1][:-4]
    assert walks.evidence["distance_m"].value == pytest.approx(FAR_M[name], abs=0.05)
    assert found.recordings[0].context.name == walks.where.trial
