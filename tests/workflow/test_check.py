"""A file is judged by what it is given as."""

import pytest

from kinertia.findings.finding import Severity
from kinertia.io.subject.reader import subject_from_options
from kinertia.settings import Subject
from kinertia.workflow.check import RecordingFiles, check_person, files_by_name, read_files
from kinertia.workflow.person import Person, read_person
from recordings import named_here, slow_beside
from refusals import refused

WALKS = named_here(
    {
        "synthetic": ("synthetic/walk.c3d", "synthetic/static.c3d"),
        "a": ("pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_a_static.c3d"),
        "b": ("pig_c3d/subject_b_walk.c3d", "pig_c3d/subject_b_static.c3d"),
    }
)
FAR_M = {"synthetic": 3.0, "a": 4.5, "b": 3.6}
"""How far they walk."""


@pytest.fixture(params=slow_beside(("synthetic", "b"), WALKS))
def given(request, file_of):
    """Name, and what is found of its files, where one of them may be given as the static trial."""

    def check(static=None):
        wanted = [RecordingFiles(file_of(name)) for name in WALKS[request.param]]
        chosen = None if static is None else wanted[static].markers
        return check_person(read_files(wanted, Person(Subject(name="A"), ()), chosen))

    return request.param, check


def test_who_stands_still_is_the_static_trial(given):
    name, check = given
    found = check()
    assert [recording.context.is_static for recording in found.recordings] == [True, False]
    assert [recording.context.name for recording in found.recordings] == [
        WALKS[name][k].split("/")[1][:-4] for k in (1, 0)
    ]
    assert "S201" not in [finding.code for finding in found.findings]
    assert not [finding for finding in found.findings if finding.severity is Severity.ERROR]


def test_a_walk_given_as_the_static_trial(given):
    name, check = given
    found = check(static=0)
    (walks,) = [finding for finding in found.findings if finding.code == "S201"]
    assert walks.severity is Severity.WARNING
    assert walks.where.trial == WALKS[name][0].split("/")[1][:-4]
    assert walks.evidence["distance_m"].value == pytest.approx(FAR_M[name], abs=0.05)
    assert found.recordings[0].context.name == walks.where.trial


@pytest.mark.parametrize("name", slow_beside(("synthetic", "b"), WALKS))
def test_files_and_options_of_a_fit_are_judged_alike(file_of, name):
    walk, static = map(file_of, WALKS[name])
    stated = {"mass_kg": 60.0, "height_m": 1.6, "sex": "male"}
    options = {"subject": {"name": "A", **stated}, "model": {"static": str(static)}, "trial": [{"markers": str(walk)}]}
    fitted = check_person(read_person(subject_from_options(options)))
    wanted = files_by_name([walk, static], static=static)
    checked = check_person(read_files(wanted, Person(Subject(name="A", **stated), ()), static))
    assert [finding.to_dict() for finding in checked.findings] == [finding.to_dict() for finding in fitted.findings]
    assert "S111" in [finding.code for finding in checked.findings], "60 kg are stated"


def test_forces_that_are_given_go_with_the_only_markers(tmp_path):
    walk, other, forces = (tmp_path / name for name in ("walk.trc", "other.trc", "grf.mot"))
    assert files_by_name([walk], forces=forces) == (RecordingFiles(walk, forces),)
    assert files_by_name([walk, other], forces=forces, static=other) == (RecordingFiles(walk, forces),)
    for files in ([walk, other], [walk, tmp_path / "walk_grf.mot"]):
        with refused("F108"):
            files_by_name(files, forces=forces)
