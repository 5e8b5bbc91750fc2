"""A marker set drafted from labels is one, and finds what the presets know by other names."""

import pytest

from kinertia.io.marker_set_draft import draft_marker_set
from kinertia.io.marker_set_file import choose_marker_set, preset_names, read_marker_set


def drafted(tmp_path, labels):
    path = tmp_path / "drafted.toml"
    path.write_text(draft_marker_set(labels, "drafted"), encoding="utf-8")
    return read_marker_set(path), path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", preset_names())
def test_a_presets_labels_draft_its_segments(tmp_path, name):
    preset = read_marker_set(name)
    draft, text = drafted(tmp_path, preset.labels)
    placed = {label: segment for segment, labels in draft.segments.items() for label in labels}
    expected = {label: segment for segment, labels in preset.segments.items() for label in labels}
    assert {label for label in expected if placed.get(label) != expected[label]} == set()
    single = {entry: labels for entry, labels in preset.landmarks.items() if len(labels) == 1}
    assert {entry for entry in single if draft.landmarks.get(entry) != single[entry]} == set()
    assert "Not placed" not in text or set(preset.labels) - set(expected)


def test_names_that_are_nearly_known_are_found_and_others_listed(tmp_path):
    labels = ["R ASIS", "L_ASIS", "R-PSIS", "LPSIS", "RHeel", "LHeel", "R_Kneee", "Banana"]
    draft, text = drafted(tmp_path, labels)
    assert draft.landmarks["asis_r"] == ("R ASIS",)
    assert draft.landmarks["heel_l"] == ("LHeel",)
    assert "R_Kneee" in draft.segments["thigh_r"]
    assert "FILL IN where they belong: Banana" in text
    assert '# ankle_lateral_r = ""  # FILL IN' in text


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_recognised_by_its_own_labels(name):
    """Plug-in Gait is part of CGM2: all labels of the latter are the latter."""
    preset = read_marker_set(name)
    assert choose_marker_set(preset.labels).name == preset.name
