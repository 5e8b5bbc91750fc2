"""A file is judged by what it is given as."""

from dataclasses import replace

import pytest

from kinertia.diagnostics.doubts import static_doubts
from kinertia.diagnostics.doubts import trial_doubts as doubts_of_trial
from kinertia.io.marker_set_file import read_marker_set
from kinertia.workflow.files import PersonFiles, RecordingFiles, check_files
from recordings import named_here


def cautions(check):
    return [verdict.sentence for verdict in check.verdicts if verdict.level == "caution"]


WALKS = named_here(
    {
        "synthetic": ("synthetic/walk.c3d", "synthetic/static.c3d"),
        "a": ("pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_a_static.c3d"),
        "b": ("pig_c3d/subject_b_walk.c3d", "pig_c3d/subject_b_static.c3d"),
    }
)
FAR_M = {"synthetic": 3.0, "b": 3.6}
"""How far they walk."""


@pytest.mark.parametrize("name", [name for name in FAR_M if name in WALKS])
def test_a_walk_given_as_the_static_trial(file_of, name):
    walk, static = (RecordingFiles(file_of(one)) for one in WALKS[name])
    (_, right), _ = check_files(PersonFiles((static, walk), None, static=static))[0]
    assert not any("walks in the static trial" in one for one in cautions(right))
    wrong = replace(walk)
    (_, check), _ = check_files(PersonFiles((wrong, walk), None, static=wrong))[0]
    assert f"the person walks in the static trial, by {FAR_M[name]} m" in cautions(check)[0]


@pytest.mark.parametrize("name", WALKS)
def test_the_fit_says_so_too(recording_of, name):
    marker_set = read_marker_set("plug-in-gait")
    walk, static = (recording_of(one, None) for one in WALKS[name])
    assert any("walks in the static trial" in one.sentence for one in static_doubts(walk, marker_set))
    assert not any("walks in" in one.sentence for one in static_doubts(static, marker_set))
    # the same distances in both: nothing to be divided by
    assert not any(one.refused for one in doubts_of_trial(walk, marker_set, walk, None))
