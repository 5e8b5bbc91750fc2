"""A static trial or a trial of another person is found by its lengths; the person's own never is."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.runner import explained
from kinertia.diagnostics.subject.same_person import static_and_trials, trials_of_one_person
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Where
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Markers
from people import codes, only_markers, person, with_markers
from recordings import here
from trials_of_people import PEOPLE as WALKERS

CLINIC = here(
    [
        ("synthetic/static.trc", "synthetic/walk.trc"),
        ("gait2354/subject01_static.trc", "gait2354/subject01_walk1.trc"),
    ]
)
JOINTS_AND_BACK = here(
    [
        ("synthetic/static.c3d", "synthetic/walk.c3d"),
        ("synthetic/clusters_static.trc", "synthetic/clusters_walk.trc"),
        ("rajagopal_walk/static_walk_1.trc", "rajagopal_walk/motion_capture_walk.trc"),
        ("pig_c3d/subject_a_static.c3d", "pig_c3d/subject_a_walk.c3d"),
        ("pig_c3d/subject_b_static.c3d", "pig_c3d/subject_b_walk.c3d"),
    ]
)
"""With markers at knees and ankles in the walk, and two at the back of the pelvis."""
PEOPLE = [*CLINIC, *JOINTS_AND_BACK]
with_joints_and_back = pytest.mark.parametrize(
    "someone", JOINTS_AND_BACK, indirect=True, ids=[static for static, _ in JOINTS_AND_BACK]
)


@pytest.fixture(params=PEOPLE, ids=[static for static, _ in PEOPLE])
def someone(request, recording_of):
    """Markers of somebody's static trial and walk, and their set."""
    static, walk = (recording_of(name).markers for name in request.param)
    return static, walk, choose_marker_set(static.labels)


def found(static, walk, marker_set):
    """Findings about the walk against the static trial that no other one explains."""
    context = person([only_markers("walk", walk)], only_markers("static", static), marker_set)
    return [reported for reported in explained(static_and_trials(context)) if reported.is_open]


def relabelled(markers, exchanged):
    return Markers(markers.time, tuple(exchanged.get(label, label) for label in markers.labels), markers.positions)


def with_heel_moved(markers, marker_set, by_m=0.06):
    """The right heel marker away from the others of its foot, and its label."""
    label = marker_set.landmarks["heel_r"][0]
    mates = [segment for segment in marker_set.segments["foot_r"] if segment != label and segment in markers.labels]
    places = markers.positions.copy()
    away = places[:, markers.labels.index(label)] - places[:, [markers.labels.index(mate) for mate in mates]].mean(
        axis=1
    )
    places[:, markers.labels.index(label)] += by_m * away / np.linalg.norm(away, axis=1, keepdims=True)
    return Markers(markers.time, markers.labels, places), label


def test_the_own_static_trial(someone):
    static, walk, marker_set = someone
    context = person([only_markers("walk", walk)], only_markers("static", static), marker_set)
    assert list(static_and_trials(context)) == []


@pytest.mark.parametrize("size", [0.9, 1.1])
def test_the_static_trial_of_a_person_of_another_size(someone, size):
    static, walk, marker_set = someone
    other = Markers(static.time, static.labels, size * static.positions)
    (reported,) = found(other, walk, marker_set)
    assert (reported.code, reported.severity, reported.where.trial) == ("S203", Severity.ERROR, "walk")
    assert reported.evidence["ratio"].value == pytest.approx(1.0 / size, abs=0.02)


@pytest.mark.parametrize(
    "someone",
    [files for files in PEOPLE if files[0] != "synthetic/static.c3d"],
    indirect=True,
    ids=lambda files: files[0],
)
@pytest.mark.parametrize("seed", range(3))
def test_markers_put_on_anew(someone, seed):
    """By 12 mm, which the two or three markers of a segment in Plug-in Gait show for most people, not for all."""
    static, walk, marker_set = someone
    offsets = np.random.default_rng(seed).normal(0.0, 0.012, (len(static.labels), 3))
    reapplied = Markers(static.time, static.labels, static.positions + offsets)
    context = person([only_markers("walk", walk)], only_markers("static", reapplied), marker_set)
    assert "S204" in codes(static_and_trials(context))


def reapplied(markers, by_m, seed=1):
    """The same markers, each elsewhere on the skin by so much along each axis."""
    offsets = np.random.default_rng(seed).normal(0.0, by_m, (len(markers.labels), 3))
    return Markers(markers.time, markers.labels, markers.positions + offsets)


def test_re_applied_markers_are_not_those_of_another_person(someone):
    """10 mm elsewhere along each axis, by chance their distances were 5 % longer, and the person another."""
    static, walk, marker_set = someone
    walker = only_markers("walk", walk)
    contexts = [
        person([walker], only_markers("static", reapplied(static, 0.01, seed)), marker_set) for seed in range(40)
    ]
    assert sum("S203" in codes(static_and_trials(context)) for context in contexts) <= 1


@pytest.mark.parametrize(
    ("by_m", "mass_kg", "height_m", "code"),
    [
        (0.0, 48.0, 1.5, None),
        (0.012, None, None, "S204"),
        (0.012, 61.0, 1.71, "S204"),
        (0.012, 54.0, None, "S203"),
        (0.012, None, 1.62, "S203"),
        (0.04, None, None, "S203"),
    ],
)
def test_the_static_trial_of_a_person_of_the_same_size(recording_of, by_m, mass_kg, height_m, code):
    """Distances alone do not tell another person from re-applied markers; what files state of the body does."""
    static, walk = (recording_of(name).markers for name in CLINIC[0])
    marker_set = choose_marker_set(static.labels)
    moving = replace(only_markers("walk", walk), mass_kg=60.0, height_m=1.70)
    still = replace(only_markers("static", reapplied(static, by_m)), mass_kg=mass_kg, height_m=height_m)
    context = person([moving], still, marker_set)
    assert codes(reported for reported in explained(static_and_trials(context)) if reported.is_open) == (
        [] if code is None else [code]
    )


@pytest.mark.parametrize("pair", here([("pig_c3d/subject_a_static.c3d", "pig_c3d/subject_b_walk.c3d")]))
def test_the_static_trial_of_somebody_else_of_one_laboratory(recording_of, pair):
    static, walk = map(recording_of, pair)
    context = person([walk], static, choose_marker_set(static.markers.labels))
    (reported,) = [answer for answer in explained(static_and_trials(context)) if answer.is_open]
    assert (reported.code, reported.severity, reported.where.trial) == ("S203", Severity.ERROR, walk.name)


def test_one_marker_that_was_moved(someone):
    static, walk, marker_set = someone
    moved, label = with_heel_moved(walk, marker_set)
    mates = [segment for segment in marker_set.segments["foot_r"] if segment in walk.labels]
    (reported,) = found(static, moved, marker_set)
    if len(mates) < 3 and reported.code == "L212":
        return  # of two markers another label may fit, too
    assert reported.code == "M161"
    assert label in reported.where.markers, "with another one where only their distance shows it"
    assert reported.evidence["difference_m"].value == pytest.approx(0.06, abs=0.02)


@with_joints_and_back
def test_labels_that_were_exchanged(someone):
    static, walk, marker_set = someone
    knee, ankle = (marker_set.landmarks[f"{name}_lateral_l"][0] for name in ("knee", "ankle"))
    (reported,) = found(static, relabelled(walk, {knee: ankle, ankle: knee}), marker_set)
    assert (reported.code, set(reported.where.markers), reported.evidence["reference"].value) == (
        "L212",
        {knee, ankle},
        "static trial",
    )


@with_joints_and_back
def test_front_and_back_of_the_pelvis_exchanged_in_one_trial(someone):
    """Two pairs at once: either alone resolves nothing."""
    static, walk, marker_set = someone
    other = {}
    for side in "rl":
        (front,), (back,) = (marker_set.landmarks[f"{name}_{side}"] for name in ("asis", "psis"))
        other |= {front: back, back: front}
    findings = found(relabelled(static, other), walk, marker_set)
    assert codes(findings) == ["L212", "L212"]
    assert {label for reported in findings for label in reported.where.markers} == set(other)


@pytest.mark.parametrize("factor", [0.97, 0.985, 1.015, 1.03])
def test_another_scale_of_the_cameras(someone, factor):
    static, walk, marker_set = someone
    middle = np.nanmean(walk.positions, axis=(0, 1))
    (reported,) = found(static, replace(walk, positions=factor * (walk.positions - middle) + middle), marker_set)
    assert reported.code == "S205"
    assert reported.evidence["scale_error"].value == pytest.approx(factor - 1.0, abs=0.01)


def test_swapped_labels_of_the_static_trial_are_not_the_trials_fault(someone):
    """They are found in it, by anatomy, and put its distances wrong."""
    static, walk, marker_set = someone
    context = person([only_markers("walk", walk)], only_markers("static", static), marker_set)
    other = Markers(static.time, static.labels, 1.1 * static.positions)
    wrong = person([only_markers("walk", walk)], only_markers("static", other), marker_set)
    named = replace(wrong, found=(finding("L201", Where(trial="static")),))
    assert codes(static_and_trials(wrong)) != []
    assert list(static_and_trials(named)) == list(static_and_trials(context)) == []


def test_each_of_two_standing_recordings_is_compared(someone):
    """D10: the comparison was left out without a word. The one that the walk contradicts is named."""
    static, walk, marker_set = someone
    other = Markers(static.time, static.labels, 1.1 * static.positions)
    standing = [only_markers("own", static), only_markers("other", other)]
    context = person([only_markers("walk", walk)], marker_set=marker_set, more_statics=standing)
    (reported,) = (answer for answer in explained(static_and_trials(context)) if answer.is_open)
    assert (reported.code, reported.where.trial, reported.evidence["reference"].value) == (
        "S203",
        "other",
        "trial walk",
    )
    both = person(
        [only_markers("walk", walk)],
        marker_set=marker_set,
        more_statics=[only_markers("one", other), only_markers("two", other)],
    )
    (reported,) = (answer for answer in explained(static_and_trials(both)) if answer.is_open)
    assert (reported.code, reported.where.trial) == ("S203", "walk")
    assert reported.evidence["reference"].value == "standing trial one and standing trial two"


@pytest.fixture(params=WALKERS)
def trials(request, recording_of):
    """Two walks and squats of one person without a static trial, and the marker set."""
    files = WALKERS[request.param].trials
    recordings = [recording_of(*WALKERS[request.param].files(name)) for name in files]
    return recordings, choose_marker_set(recordings[0].markers.labels)


def test_trials_of_one_person(trials):
    recordings, marker_set = trials
    assert list(trials_of_one_person(person(recordings, marker_set=marker_set))) == []


def test_trials_of_two_people(trials):
    """D11: the one that the others contradict; both where there are no others."""
    (walk, again, squats), marker_set = trials
    other = with_markers(walk, replace(walk.markers, positions=1.08 * walk.markers.positions))
    findings = list(trials_of_one_person(person([other, again, squats], marker_set=marker_set)))
    assert {(reported.code, reported.where.trial) for reported in findings} == {("S305", walk.name)}
    assert findings[0].evidence["ratio"].value == pytest.approx(1.08, abs=0.02)
    both = list(trials_of_one_person(person([other, again], marker_set=marker_set)))
    assert [(reported.code, reported.where.trial) for reported in both] == [("S305", walk.name), ("S305", again.name)]


def test_a_marker_that_was_moved_between_trials_is_no_other_person(trials):
    """D8: it was."""
    (walk, again, squats), marker_set = trials
    moved, label = with_heel_moved(again.markers, marker_set, 0.08)
    spoilt = with_markers(again, moved)
    findings = list(trials_of_one_person(person([walk, spoilt, squats], marker_set=marker_set)))
    assert {(reported.code, reported.where.trial, reported.where.markers) for reported in findings} == {
        ("M161", again.name, (label,))
    }
    assert {reported.severity for reported in findings} == {Severity.WARNING}
