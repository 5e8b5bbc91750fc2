"""A file is judged by what it is given as."""

from dataclasses import replace

import pytest

from kinertia.checks.files import PersonFiles, RecordingFiles, check_files
from kinertia.estimation.doubts import static_doubts
from kinertia.estimation.doubts import trial_doubts as doubts_of_trial
from kinertia.io.marker_set_file import read_marker_set


def cautions(check):
    return [verdict.sentence for verdict in check.verdicts if verdict.level == "caution"]


def test_a_walk_given_as_the_static_trial(measured_folder):
    folder = measured_folder / "pig_c3d"
    static, walk = (RecordingFiles(folder / f"subject_b_{name}.c3d") for name in ("static", "walk"))
    (_, right), _ = check_files(PersonFiles((static, walk), None, static=static))[0]
    assert not any("walks in the static trial" in one for one in cautions(right))
    wrong = replace(walk)
    (_, check), _ = check_files(PersonFiles((wrong, walk), None, static=wrong))[0]
    assert "the person walks in the static trial, by 3.6 m" in cautions(check)[0]


@pytest.mark.parametrize("name", ["a", "b"])
def test_the_fit_says_so_too(recording_of, name):
    marker_set = read_marker_set("plug-in-gait")
    walk, static = (recording_of(f"pig_c3d/subject_{name}_{kind}.c3d", None) for kind in ("walk", "static"))
    assert any("walks in the static trial" in one.sentence for one in static_doubts(walk, marker_set))
    assert not any("walks in" in one.sentence for one in static_doubts(static, marker_set))
    # the same distances in both: nothing to be divided by
    assert not any(one.refused for one in doubts_of_trial(walk, marker_set, walk, None))
