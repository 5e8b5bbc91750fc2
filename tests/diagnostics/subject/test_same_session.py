"""Trials that were recorded with another scale of the cameras are named; sound ones never are."""

from itertools import permutations

import pytest

from kinertia.diagnostics.evidence.segment_distances import SegmentDistances
from kinertia.diagnostics.subject.same_person import static_and_trials
from kinertia.diagnostics.subject.same_session import AGAINST_STANDING, camera_scale, trial_scales
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from people import codes, person, scaled, with_markers
from recordings import here, named_here
from trials_of_people import PEOPLE

KNOWN = [
    ("synthetic/static.trc", "synthetic/walk.trc"),
    ("synthetic/static.trc", "synthetic/run.trc"),
    ("synthetic/static.trc", "synthetic/squats.trc"),
    ("synthetic/static.c3d", "synthetic/walk.c3d"),
    ("synthetic/clusters_static.trc", "synthetic/clusters_walk.trc"),
    ("gait2354/subject01_static.trc", "gait2354/subject01_walk1.trc"),
    ("rajagopal_walk/static_walk_1.trc", "rajagopal_walk/motion_capture_walk.trc"),
    ("pig_c3d/subject_a_static.c3d", "pig_c3d/subject_a_walk.c3d"),
    ("pig_c3d/subject_b_static.c3d", "pig_c3d/subject_b_walk.c3d"),
    ("subject4/static1.trc", "subject4/walking1.trc"),
    ("subject4/static1.trc", "subject4/walking2.trc"),
    ("subject4/static1.trc", "subject4/squats1.trc"),
    ("field/rajagopal_run/static_run.trc", "field/rajagopal_run/motion_capture_run.trc"),
    ("field/hamner_run/subject02_static.trc", "field/hamner_run/subject02_running.trc"),
]
STATIC = here(KNOWN)
SOFT_CHILDREN = here(
    [
        (f"field/biomechzoo/{child}/static.c3d", f"field/biomechzoo/{child}/{trial}.c3d")
        for child in ("HC002D", "HC032A", "HC036A", "HC040A")
        for trial in ("straight", "turn")
    ]
)
"""Their thighs, shanks and feet have one distance each, up to 4 % longer or shorter than in standing."""
RUN_ON_A_TREADMILL = KNOWN[-1]
"""The runner's soft feet are shorter than in standing: a scale that makes them longer is not seen."""
OTHER_SCALES = [
    (pair, factor) for pair in STATIC for factor in (0.985, 1.015) if factor < 1.0 or pair != RUN_ON_A_TREADMILL
]
PAIRS = [(name, *pair) for name, someone in PEOPLE.items() for pair in permutations(someone.trials, 2)]
MARKER_SETS = {"synthetic": "cleveland-clinic", "subject4": "opencap-mocap"}
STANDING_AND_TWO_WALKS = named_here(
    {
        "synthetic": ("synthetic/static.trc", "synthetic/walk.trc", "synthetic/alike.trc"),
        "subject4": ("subject4/static1.trc", "subject4/walking1.trc", "subject4/walking2.trc"),
    }
)


@pytest.fixture
def scale_of(recording_of):
    """The camera scale of somebody's trial against the static one, once it is scaled by a factor."""

    def scale(pair, factor):
        static, trial = (recording_of(name).markers for name in pair)
        distances = SegmentDistances.of(static, scaled(trial, factor), choose_marker_set(static.labels))
        return camera_scale(distances, AGAINST_STANDING)

    return scale


@pytest.mark.parametrize("factor", [0.995, 1.0, 1.005])
@pytest.mark.parametrize("pair", STATIC, ids=[trial for _, trial in STATIC])
def test_a_sound_static_trial(scale_of, pair, factor):
    """With a margin."""
    assert scale_of(pair, factor) is None


@pytest.mark.parametrize("pair", SOFT_CHILDREN, ids=[trial for _, trial in SOFT_CHILDREN])
def test_skin_that_moves_alike_in_several_segments_is_no_scale(scale_of, pair):
    assert scale_of(pair, 1.0) is None


@pytest.mark.parametrize(("pair", "factor"), OTHER_SCALES)
def test_another_scale_than_in_the_static_trial(scale_of, pair, factor):
    assert scale_of(pair, factor).error == pytest.approx(factor - 1.0, abs=0.005)


@pytest.mark.parametrize(("name", "first", "second"), PAIRS)
def test_trials_of_one_person(recording_of, name, first, second):
    """Of two trials either may be wrong: both are named, with opposite signs."""
    first_trial, other = (recording_of(*PEOPLE[name].files(trial)) for trial in (first, second))
    marker_set = read_marker_set(MARKER_SETS[name])
    assert list(trial_scales(person([first_trial, other], marker_set=marker_set))) == []
    for factor in (0.985, 1.015):
        spoilt = with_markers(other, scaled(other.markers, factor))
        found = list(trial_scales(person([first_trial, spoilt], marker_set=marker_set)))
        assert codes(found) == ["S205", "S205"]
        errors = {finding.where.trial: finding.evidence["scale_error"].value for finding in found}
        assert errors == pytest.approx({other.name: factor - 1.0, first_trial.name: 1.0 - factor}, abs=0.003)


@pytest.mark.parametrize("spoilt", [0, 1])
@pytest.mark.parametrize("name", STANDING_AND_TWO_WALKS)
def test_static_trial_and_majority_decide_which_is_wrong(recording_of, name, spoilt):
    """The first of the trials is as often wrong as any other."""
    static, *walks = (recording_of(file) for file in STANDING_AND_TWO_WALKS[name])
    walks[spoilt] = with_markers(walks[spoilt], scaled(walks[spoilt].markers, 1.015))
    marker_set = choose_marker_set(static.markers.labels)
    (found,) = trial_scales(person(walks, static, marker_set))
    assert found.where.trial == walks[spoilt].name
    third = with_markers(walks[1 - spoilt], walks[1 - spoilt].markers, "third")
    found = list(trial_scales(person([*walks, third], marker_set=marker_set)))
    assert {finding.where.trial for finding in found} == {walks[spoilt].name}
    assert [finding.where.trial for finding in static_and_trials(person(walks, static, marker_set))] == [
        walks[spoilt].name
    ]
