import multiprocessing
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.errors import TrialError
from kinertia.io.c3d.writer import write_c3d
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.io.subject.person_recordings import read_inputs
from kinertia.io.subject.reader import read_subject
from kinertia.synthetic.laboratory import PERFECT, LabNoise, record, write_lab
from kinertia.synthetic.walk import centre_of_pressure, walk, walking_subject
from kinertia.trial.data import LOAD_THRESHOLD_N, Recording
from kinertia.trial.plate_assignment import build_trial

RATE_HZ, RATIO = 500.0, 5


@pytest.fixture(scope="module")
def subject():
    return walking_subject()


@pytest.fixture(scope="module")
def trial(subject):
    return walk(subject, 2.7, RATE_HZ, 0.75)


@pytest.fixture(scope="module", params=["noisy", pytest.param("perfect", marks=pytest.mark.slow)])
def measured(request, subject, trial):
    noise = LabNoise() if request.param == "noisy" else PERFECT
    return record(subject, trial, noise, np.random.default_rng(7), RATIO)


def read_back(folder, measured, kind):
    if kind == "trc":
        wanted = read_subject(write_lab(folder / "lab", measured, kind))
    else:
        # in a process of its own: once opensim has been at work in this one, ezc3d cannot write (both are SWIG modules)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            wanted = read_subject(pool.apply(write_lab, (folder / "lab", measured, kind)))
    static, (walked,), _ = read_inputs(wanted)
    return wanted, static, walked.recording


@pytest.mark.parametrize(
    ("kind", "place_m", "force_n", "moment_nm"), [("trc", 1e-9, 1e-9, 1e-9), ("c3d", 1e-6, 1e-4, 1e-3)]
)
def test_files_give_back_what_was_written(tmp_path, measured, kind, place_m, force_n, moment_nm):
    """TRC rounds to 1e-6 mm, C3D to single precision."""
    wanted, static, walked = read_back(tmp_path, measured, kind)
    assert wanted.subject.mass_kg == measured.walk.mass_kg
    for read, written in ((static, measured.static), (walked, measured.walk)):
        assert read.markers.labels == written.markers.labels
        np.testing.assert_allclose(read.markers.time, written.markers.time, atol=1e-9)
        np.testing.assert_allclose(read.markers.positions, written.markers.positions, rtol=0, atol=place_m)
    np.testing.assert_allclose(walked.plates.time, measured.walk.plates.time, atol=1e-9)
    np.testing.assert_allclose(walked.plates.force, measured.walk.plates.force, rtol=0, atol=force_n)
    np.testing.assert_allclose(walked.plates.moment, measured.walk.plates.moment, rtol=0, atol=moment_nm)
    if kind == "c3d":
        assert walked.mass_kg == pytest.approx(72.6, abs=1e-4)
        assert walked.height_m == pytest.approx(1.803, abs=1e-6)
        for read, written in zip(walked.plates.corners, measured.walk.plates.corners, strict=True):
            gaps = np.linalg.norm(read[:, None] - written, axis=-1)
            assert gaps.min(axis=0).max() < 1e-6
        assert not [note for note in walked.notes if "plate" in note]


def test_plates_catch_one_whole_contact_of_each_foot(measured, trial):
    plates = measured.walk.plates
    loaded = plates.force[:, :, 1] > 0
    assert loaded.any(axis=0).all()
    assert not loaded[[0, -1]].any()
    for p in range(2):
        pressure = centre_of_pressure(np.hstack([plates.force[:, p], plates.moment[:, p]]))[loaded[:, p]]
        low, high = plates.corners[p].min(axis=0), plates.corners[p].max(axis=0)
        assert (pressure[:, [0, 2]] > low[[0, 2]]).all()
        assert (pressure[:, [0, 2]] < high[[0, 2]]).all()
    walked_on = (trial.foot_loads[: len(plates.time), :, 1] >= LOAD_THRESHOLD_N).sum()
    assert loaded.sum() < 0.7 * walked_on


def test_pipeline_finds_the_measured_frames(subject, trial):
    """The steps off the plates are seen by the feet's markers alone."""
    recording = record(subject, trial, PERFECT, np.random.default_rng(7), RATIO).walk
    built = build_trial(recording, read_marker_set("cleveland-clinic").foot_labels())
    on_plates = np.abs(
        recording.plates.force.sum(axis=1) - trial.foot_loads[: len(recording.plates.time), :, :3].sum(axis=1)
    )
    truly = on_plates.max(axis=1)[::RATIO] < 2 * LOAD_THRESHOLD_N
    assert not (built.measured & ~truly).any()
    assert (truly & ~built.measured).sum() <= 8
    assert built.measured.sum() > 90


def test_perfect_laboratory_measures_the_truth(subject, trial):
    walked = record(subject, trial, PERFECT, np.random.default_rng(7), RATIO).walk
    np.testing.assert_array_equal(walked.markers.positions, trial.markers.positions[: len(walked.plates.time) : RATIO])


def test_noise_is_of_the_announced_size(subject, trial):
    exact = record(subject, trial, PERFECT, np.random.default_rng(7), RATIO)
    cameras = record(subject, trial, LabNoise(skin="none"), np.random.default_rng(7), RATIO)
    error = cameras.walk.markers.positions - exact.walk.markers.positions
    assert error.std() == pytest.approx(0.0005, rel=0.05)
    study = record(subject, trial, LabNoise(skin="study"), np.random.default_rng(7), RATIO)
    assert 0.003 < (study.walk.markers.positions - exact.walk.markers.positions).std() < 0.005


def test_the_second_plate_reads_too_much_and_both_late(subject, trial):
    exact = record(subject, trial, PERFECT, np.random.default_rng(7), RATIO).walk.plates
    late = round(0.01 / (exact.time[1] - exact.time[0]))
    noise = replace(PERFECT, gain=0.04, delay_s=0.01)
    read = record(subject, trial, noise, np.random.default_rng(7), RATIO).walk.plates
    factor = np.array([[1.0], [1.04]])
    assert late > 1
    for before, after in ((exact.force, read.force), (exact.moment, read.moment)):
        np.testing.assert_allclose(after[late:], factor * before[:-late])


def test_a_trial_without_whole_contacts_is_refused(subject):
    with pytest.raises(TrialError, match="two strides"):
        record(subject, walk(subject, 0.5), PERFECT, np.random.default_rng(0))


def test_c3d_needs_corners_and_a_matching_time_base(tmp_path, measured):
    walked = measured.walk
    plates = walked.plates
    without = type(plates)(plates.time, plates.names, plates.force, plates.moment, plates.declared_feet)
    with pytest.raises(ValueError, match="corners"):
        write_c3d(tmp_path / "a.c3d", Recording("a", walked.markers, without))
    late = type(plates)(
        plates.time + 0.5, plates.names, plates.force, plates.moment, plates.declared_feet, plates.corners
    )
    with pytest.raises(ValueError, match="start with the markers"):
        write_c3d(tmp_path / "a.c3d", Recording("a", walked.markers, late))


@pytest.mark.parametrize("degrees", [0.0, 37.0, 50.0, -120.0])
def test_c3d_holds_plates_that_are_rotated_in_the_laboratory(tmp_path, measured, degrees):
    walked, plates = measured.walk, measured.walk.plates
    rotation = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    force, moment, corners = (vectors @ rotation.T for vectors in (plates.force, plates.moment, plates.corners))
    rotated = replace(plates, force=force, moment=moment, corners=corners)
    markers = replace(walked.markers, positions=walked.markers.positions @ rotation.T)
    write_c3d(tmp_path / "a.c3d", replace(walked, markers=markers, plates=rotated))
    read = read_recording(tmp_path / "a.c3d").plates
    loaded = read.force[..., 1] > 20.0
    assert np.abs(read.force - force)[loaded].max() < 0.001
    assert np.abs(read.moment - moment)[loaded].max() < 0.001
