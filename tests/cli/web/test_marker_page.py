"""Places of markers: as the set has them, guessed where none fits, assigned by hand, saved for the command line."""

import shutil
from urllib.parse import urlencode

import numpy as np
import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")

from app_server import running
from kinertia.cli.web.entries import entries, write
from kinertia.cli.web.library import Library
from kinertia.cli.web.marker_page import FILE, in_words, marker_positions, save_places
from kinertia.errors import KinertiaError, SettingsError
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.subject.reader import read_subject
from kinertia.io.text.trc import read_trc

WALK = {"model": {"static": "static.c3d"}, "trial": [{"markers": "walk.c3d"}], "subject": {"sex": "male"}}


@pytest.fixture
def person(tmp_path, c3d_lab):
    person = Library(tmp_path / "library").add("Anna")
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(c3d_lab / name, person.folder / name)
    write(person, WALK)
    return person


def renamed(sample_walk, person, names):
    """The static trial of the sample walk with labels that no preset has."""
    text = (sample_walk / "gait2354" / "subject01_static.trc").read_text()
    for old, new in names.items():
        text = text.replace(old, new)
    (person.folder / "static.trc").write_text(text)
    write(person, {"model": {"static": "static.trc"}, "trial": [{"markers": "static.trc"}]})


def test_a_known_set_has_its_places(person):
    places = marker_positions(person)
    assert (places.set_name, places.fits, dict(places.missing)) == ("Plug-in Gait", True, {})
    assert sorted(places.unknown) == ["LFIN", "RFIN"]
    assert places.segments["RTHI"] == "thigh_r"
    assert places.landmarks["LKNE"] == "knee_lateral_l"
    head, foot = (places.positions[places.labels.index(label)] for label in ("LFHD", "LTOE"))
    assert head[1] - foot[1] > 1.2
    assert np.isfinite(places.positions).all()


def test_an_unknown_marker_is_assigned_and_the_set_is_the_persons(person):
    places = marker_positions(person)
    save_places(person, {**places.segments, "LFIN": "forearm_l"}, places.landmarks)
    saved, preset = read_marker_set(person.folder / FILE), read_marker_set("plug-in-gait")
    assert "LFIN" in saved.segments["forearm_l"]
    assert saved.landmarks == {
        key: value for key, value in preset.landmarks.items() if set(value) <= set(places.labels)
    }
    assert saved.widths == preset.widths, "joint widths of the C3D file still count"
    assert read_subject(person.subject).model.markers == (person.folder / FILE).resolve()
    again = marker_positions(person)
    assert again.unknown == ("RFIN",)
    assert again.fits


def test_saving_what_is_there_changes_no_place(person):
    places = marker_positions(person)
    save_places(person, places.segments, places.landmarks)
    again = marker_positions(person)
    assert (again.segments, again.landmarks) == (places.segments, places.landmarks)


def test_what_makes_no_set_is_said_and_leaves_nothing(person):
    places = marker_positions(person)
    pelvis = {label: place for label, place in places.segments.items() if place != "pelvis"}
    with pytest.raises(KinertiaError, match="pelvis must list at least three markers"):
        save_places(person, pelvis, places.landmarks)
    assert not (person.folder / FILE).exists()
    assert entries(person) == WALK


def test_places_are_guessed_where_no_set_fits_and_what_lacks_is_listed(person, sample_walk):
    labels = read_trc(sample_walk / "gait2354" / "subject01_static.trc").labels
    renamed(sample_walk, person, {label: f"Q{k:02d}" for k, label in enumerate(labels) if "Thigh" in label})
    places = marker_positions(person)
    assert not places.unknown or all(label.startswith("Q") for label in places.unknown)
    assert set(places.missing) == {label for label in labels if "Thigh" in label}


def test_markers_of_a_model_are_its_own(person, synthetic_lab):
    for name in ("walk.trc", "scaled.osim"):
        shutil.copyfile(synthetic_lab / name, person.folder / name)
    write(person, {"model": {"osim": "scaled.osim"}, "trial": [{"markers": "walk.trc"}]})
    places = marker_positions(person)
    assert places.of_model
    with pytest.raises(SettingsError, match="in its file"):
        save_places(person, {}, {})


def test_the_page_shows_and_saves_them(tmp_path, c3d_lab):
    with running(tmp_path / "library") as app:
        person = app.library.add("Anna")
        assert "no recording is marked" in app.ask("/people/Anna/markers").text
        shutil.copyfile(c3d_lab / "static.c3d", person.folder / "static.c3d")
        write(person, {"model": {"static": "static.c3d"}, "trial": [{"markers": "static.c3d"}]})
        page = app.ask("/people/Anna/markers").text
        assert "2 markers have no place" in page
        places = marker_positions(person)
        form = {f"segment:{label}": place for label, place in {**places.segments, "RFIN": "forearm_r"}.items()}
        form |= {f"landmark:{label}": place for label, place in places.landmarks.items()}
        assert app.post("/people/Anna/markers", urlencode(form)).status == 303
        assert marker_positions(person).unknown == ("LFIN",)
        refused = app.post("/people/Anna/markers", urlencode({"segment:RFIN": "pelvis"}))
        assert refused.status == 422
        assert "pelvis must list at least three markers" in refused.text


def test_names_are_in_words():
    assert [in_words(name) for name in ("upper_arm_r", "c7", "sternal_notch")] == [
        "right upper arm",
        "c7",
        "sternal notch",
    ]
