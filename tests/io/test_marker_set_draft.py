"""A marker set drafted from a recording is one, and finds what the presets know by other names."""

from dataclasses import replace

import numpy as np
import pytest

from generic_static import generic_static, recording, standing_positions
from kinertia.io.marker_set_draft import draft_marker_set, known_places, preset_of
from kinertia.io.marker_set_file import choose_marker_set, preset_names, read_marker_set
from kinertia.model.gait27 import build_gait27
from recordings import here, slow_beside

STANDING = {
    "lasem": ("field/lasem/static.c3d", {"knee_medial_r": ("RMEPI",), "metatarsal_l": ("LP1MT", "LP5MT")}),
    "unipd": ("field/unipd/static.c3d", {"ankle_lateral_r": ("RLM",), "toe_r": ("RIIT",), "metatarsal_r": ("RVMH",)}),
    "opensim_core": ("field/opensim_core/static.c3d", {"knee_lateral_l": ("LLFC",), "metatarsal_r": ("RMT1", "RMT2")}),
    "jam": ("field/jam/static1.trc", {"ankle_medial_l": ("L.Man",), "wrist_r": ("R.Wrist",)}),
    "child": ("field/biomechzoo/HC002D/static.c3d", {"sacrum": ("SACR",), "knee_lateral_r": ("RKNE",)}),
    "child who leans": ("field/biomechzoo/HC040A/static.c3d", {"sacrum": ("SACR",), "heel_l": ("LHEE",)}),
    "subject4": ("subject4/static1.trc", {"heel_r": ("r_calc",), "knee_medial_l": ("L_mknee",)}),
}
"""Static trials, and some of the landmarks in them."""
LEGS = {f"{name}_{side}" for name in ("asis", "knee_lateral", "ankle_lateral", "heel", "metatarsal") for side in "rl"}


def drafted(tmp_path, static):
    path = tmp_path / "drafted.toml"
    path.write_text(draft_marker_set(static, "drafted").text, encoding="utf-8")
    return read_marker_set(path), path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", preset_names())
def test_a_presets_labels_are_known_in_its_segments(name):
    preset = read_marker_set(name)
    landmarks, segments = known_places(preset.labels)
    placed = {label: segment for segment, labels in segments.items() for label in labels}
    expected = {label: segment for segment, labels in preset.segments.items() for label in labels}
    assert {label for label in expected if placed.get(label) != expected[label]} == set()
    single = {entry: list(labels) for entry, labels in preset.landmarks.items() if len(labels) == 1}
    assert {entry for entry in single if landmarks.get(entry) != single[entry]} == set()


def test_where_nobody_stands_names_that_are_nearly_known_are_found_and_others_listed(tmp_path):
    labels = ["R ASIS", "L_ASIS", "R-PSIS", "LPSIS", "RHeel", "LHeel", "R_Kneee", "Banana"]
    draft, text = drafted(tmp_path, recording({label: np.full(3, 1 + k / 10) for k, label in enumerate(labels)}))
    assert draft.landmarks["asis_r"] == ("R ASIS",)
    assert draft.landmarks["heel_l"] == ("LHeel",)
    assert "R_Kneee" in draft.segments["thigh_r"]
    assert "FILL IN where they belong: Banana" in text
    assert '# ankle_lateral_r = ""  # FILL IN' in text
    assert "# NOTE: " in text


def turned(positions, angle_deg, shift=(0.0, 0.0, 0.0)):
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return {label: rotation @ at + shift for label, at in positions.items()}


@pytest.mark.parametrize("angle_deg", [0.0, 50.0, 133.0, 180.0, 270.0])
def test_the_landmarks_of_a_preset_are_found_wherever_one_stands(tmp_path, angle_deg):
    static = recording(turned(standing_positions(1.6), angle_deg, (2.0, 0.3, -5.0)))
    draft, text = drafted(tmp_path, static)
    preset = choose_marker_set(static.markers.labels)
    for landmark, labels in preset.landmarks.items():
        if landmark != "head_top":
            assert set(draft.landmarks[landmark]) == set(labels), landmark
    placed = {label: segment for segment, labels in draft.segments.items() for label in labels}
    expected = {label: segment for segment, labels in preset.segments.items() for label in labels}
    assert {label: placed.get(label) for label in expected if placed.get(label) not in (None, expected[label])} == {}
    assert "NOTE" not in text
    assert "Toe.Tip" in text.split("toe_r = ")[1].splitlines()[0]


@pytest.mark.parametrize("height_m", [1.1, 1.5, 1.95])
def test_labels_without_meaning_still_show_the_legs(tmp_path, height_m):
    positions = standing_positions(height_m)
    names = {label: f"M{k:02d}" for k, label in enumerate(sorted(positions))}
    static = recording({names[label]: at for label, at in positions.items()})
    draft, text = drafted(tmp_path, static)
    by_name, _ = drafted(tmp_path, recording(positions))
    for landmark in LEGS | {"knee_medial_r", "knee_medial_l", "ankle_medial_r", "ankle_medial_l"}:
        assert {names[label] for label in by_name.landmarks[landmark]} == set(draft.landmarks[landmark]), landmark
    assert "by its place alone" in text
    assert '# elbow_lateral_r = ""  # FILL IN' in text


def test_without_arms_and_head_a_draft_makes_a_model(tmp_path):
    gone = ("Elbow", "Wrist", "Bicep", "Acrom", "Temple", "Head", "Sternum")
    positions = {name: at for name, at in standing_positions().items() if not any(part in name for part in gone)}
    draft, text = drafted(tmp_path, recording(positions))
    assert set(draft.landmarks) >= LEGS
    assert '# acromion_r = ""  # FILL IN' in text
    build_gait27(recording(positions), draft, 1.75, "male")


def test_mirrored_axes_keep_the_labels_and_are_named(tmp_path):
    mirrored = {label: at * [1.0, 1.0, -1.0] for label, at in standing_positions().items()}
    draft, text = drafted(tmp_path, recording(mirrored))
    assert draft.landmarks["heel_r"] == ("R.Heel",)
    assert "R.Thigh.Upper" in draft.segments["thigh_r"]
    assert "NOTE: right labels are on the person's left" in text


def test_one_swapped_pair_keeps_its_labels_and_is_named(tmp_path):
    positions = standing_positions()
    positions["R.Heel"], positions["L.Heel"] = positions["L.Heel"], positions["R.Heel"]
    draft, text = drafted(tmp_path, recording(positions))
    assert draft.landmarks["heel_r"] == ("R.Heel",)
    assert "ITS LABEL IS OF THE OTHER SIDE" in text.split("heel_r = ")[1].splitlines()[0]


def test_a_side_without_an_inner_marker_gets_a_width_and_a_wand(tmp_path):
    positions = {name: at for name, at in standing_positions().items() if "Knee.Med" not in name}
    draft, _ = drafted(tmp_path, recording(positions))
    assert draft.widths == {"knee_r": "RKneeWidth", "knee_l": "LKneeWidth"}
    assert draft.landmarks["thigh_wand_r"] == ("R.Thigh.Rear",)


@pytest.mark.parametrize("hidden", [pytest.param(0, marks=pytest.mark.slow), 2])
def test_computed_points_are_in_no_segment_and_listed(tmp_path, hidden):
    """Also where the marker from which bones were computed is hidden in some frames."""
    rng = np.random.default_rng(3)
    positions = standing_positions()
    static = recording(positions, frames=30)
    moving = static.markers.positions + rng.normal(scale=3e-4, size=static.markers.positions.shape)
    at = dict(zip(static.markers.labels, np.moveaxis(moving, 1, 0), strict=True))
    knee = (at["R.Knee.Lat"] + at["R.Knee.Med"]) / 2
    axes = {"O": 0.0, "A": [0.2, 0.0, 0.0], "L": [0.0, 0.0, -0.2], "P": [0.0, 0.3, 0.0]}
    at |= {f"RFE{end}": knee + offset + [0.0, 0.002, 0.0] for end, offset in axes.items()}
    at |= {"Knie": knee, "RHJC": at["R.ASIS"] - 0.05, "R.HeelGround": at["R.Heel"] * [1.0, 0.0, 1.0]}
    at |= {"RStation": np.zeros((30, 3)), "Copy": at["R.Heel"].copy()}
    for label in ("RFEO", "RFEA", "RFEL", "RFEP", "R.ASIS"):
        at[label][:hidden] = np.nan
    markers = type(static.markers)(static.markers.time, tuple(at), np.stack(list(at.values()), axis=1))
    draft, text = drafted(tmp_path, type(static)("static", markers))
    placed = {label for labels in draft.segments.values() for label in labels}
    added = {"RFEO", "RFEA", "RFEL", "RFEP", "Knie", "RHJC", "R.HeelGround", "RStation", "Copy"}
    assert not placed & added
    for label in added:
        assert f"#   {label}: " in text
    assert {label for landmark in draft.landmarks.values() for label in landmark} & added == set()


def test_the_lumbar_spine_is_in_no_segment(tmp_path):
    lumbar = {"Lumbar": 1.75 * np.array([-0.065, 0.605, 0.0]), "Thoracic": 1.75 * np.array([-0.07, 0.7, 0.0])}
    draft, text = drafted(tmp_path, recording(standing_positions() | lumbar))
    assert "Thoracic" in draft.segments["torso"]
    assert "FILL IN where they belong: " in text
    assert "Lumbar" in text.split("FILL IN where they belong: ")[1]


def test_a_draft_says_which_landmarks_of_the_legs_it_lacks():
    positions = {label: at for label, at in standing_positions().items() if label not in ("R.Heel", "V.Sacral")}
    draft = draft_marker_set(recording(positions | {"L.PSIS": np.array([-0.1, 0.99, -0.05])}), "x")
    assert "heel_r" in draft.needed
    assert draft_marker_set(generic_static(), "x").needed == ()


def test_a_preset_without_which_no_model_can_be_made_is_none():
    preset = preset_of(generic_static())
    assert preset is not None
    assert preset.name == "Cleveland Clinic"
    names = {"R.Knee.Med": "R.Innen", "L.Knee.Med": "L.Innen"}
    assert preset_of(recording({names.get(label, label): at for label, at in standing_positions().items()})) is None


def test_a_marker_that_is_hardly_ever_seen_is_not_used(tmp_path):
    static = generic_static()
    static.markers.positions[1:, static.markers.labels.index("R.Heel")] = np.nan
    draft, text = drafted(tmp_path, static)
    assert "heel_r" not in draft.landmarks
    assert "R.Heel: visible in only 20 % of the frames" in text


def test_what_one_side_lacks_is_placed_as_on_the_other_by_its_label(tmp_path):
    """A right foot that is lifted, as in every frame of a walk, is not where a standing person has it."""
    static = generic_static()
    for label in ("R.Heel", "R.Toe.Tip", "R.Midfoot.Lat", "R.Midfoot.Sup"):
        if label in static.markers.labels:
            static.markers.positions[:, static.markers.labels.index(label)] += np.array([-0.3, 0.35, 0.0])
    draft, text = drafted(tmp_path, static)
    assert draft.landmarks["heel_r"] == ("R.Heel",)
    assert "as on the other side, going by its label" in text


@pytest.mark.parametrize(
    "name", slow_beside(("lasem", "unipd", "child"), [name for name, (file, _) in STANDING.items() if here([file])])
)
def test_legs_of_measured_laboratories_are_complete(tmp_path, name, recording_of):
    file, expected = STANDING[name]
    static = recording_of(file)
    draft, text = drafted(tmp_path, static)
    assert set(draft.landmarks) >= LEGS
    assert "NOTE" not in text
    assert {landmark: set(draft.landmarks[landmark]) for landmark in expected} == {
        landmark: set(labels) for landmark, labels in expected.items()
    }
    placed = {label for labels in draft.segments.values() for label in labels}
    assert not placed & {"RIMH", "SACR"} - {"SACR" if "child" in name else ""}
    assert not any(label.endswith(("HJC", "KJC", "FEO", "CentreOfMass")) for label in placed)


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_recognised_by_its_own_labels(name):
    """Plug-in Gait is part of CGM2: all labels of the latter are the latter."""
    preset = read_marker_set(name)
    assert choose_marker_set(preset.labels).name == preset.name


def test_of_somebody_who_moves_a_frame_is_taken_and_said_so(tmp_path):
    standing = recording(standing_positions(), frames=60)
    along = np.linspace(0.0, 1.0, 60)[:, None, None] * [2.0, 0.0, 0.0]
    moving = replace(standing.markers, positions=standing.markers.positions + along)
    draft, text = drafted(tmp_path, replace(standing, markers=moving))
    assert set(draft.landmarks) >= LEGS
    assert "NOTE: no one stands still here" in text
