import numpy as np
import pytest

from kinertia.errors import MarkerSetError
from kinertia.io.marker_set_file import choose_marker_set, marker_set_of, preset_names, read_marker_set
from kinertia.model.marker_set import check_marker_set, nearest_labels
from kinertia.trial.data import Markers
from recordings import here
from refusals import refused

STATICS = {
    "gait2354/subject01_static.trc": "Cleveland Clinic",
    "rajagopal_walk/static_walk_1.trc": "Rajagopal",
    "pig_c3d/subject_a_static.c3d": "Plug-in Gait",
    "synthetic/static.trc": "Cleveland Clinic",
    "synthetic/static.c3d": "Plug-in Gait",
    "pig_c3d/subject_b_static.c3d": "Plug-in Gait",
}
SMALL = """
name = "mine"
[landmarks]
asis_r = "RA"
asis_l = ["LA", "LB"]
[segments]
pelvis = ["RA", "LA", "LB"]
"""


@pytest.mark.parametrize("path", here(STATICS))
def test_each_preset_finds_its_own_files(recording_of, path):
    assert choose_marker_set(recording_of(path).markers.labels).name == STATICS[path]


def test_a_set_without_preset_lists_what_is_missing_and_the_nearest_labels(recording_of):
    known = recording_of("synthetic/static.trc").markers.labels
    labels = [f"{label}_1" for label in known]
    with pytest.raises(MarkerSetError) as caught:
        choose_marker_set(labels)
    assert caught.value.finding.code == "L101"
    assert caught.value.finding.evidence["labels_found"].value == 0
    assert caught.value.missing
    assert set(caught.value.nearest) == set(caught.value.missing)


@pytest.mark.parametrize("name", preset_names())
def test_presets_refuse_each_others_labels(name):
    preset = read_marker_set(name)
    for other in preset_names():
        labels = read_marker_set(other).labels
        if other != name and {other, name} <= {"cgm2", "plug-in-gait", "plug-in-gait-lower-body"}:
            continue  # each of the former has most of the latter's markers, and more
        if other == name:
            check_marker_set(preset, labels)
            assert choose_marker_set(labels) == preset
        else:
            with pytest.raises(MarkerSetError) as caught:
                check_marker_set(preset, labels)
            assert caught.value.finding.code == "L101"
            assert caught.value.finding.evidence["name"].value == preset.name


@pytest.mark.parametrize("lost", ["LASI", "T10", "RTOE", "RPSI"])
def test_a_whole_set_that_lacks_a_label_is_not_taken_for_its_lower_half(lost):
    labels = [label for label in read_marker_set("plug-in-gait").labels if label != lost]
    assert choose_marker_set(labels).name == "Plug-in Gait"
    legs = [label for label in read_marker_set("plug-in-gait-lower-body").labels if label not in (lost, "SACR")]
    assert choose_marker_set(legs).name == "Plug-in Gait, lower body"


@pytest.mark.parametrize("trunk", [False, True])
@pytest.mark.parametrize("name", preset_names())
def test_a_preset_is_recognised_by_its_legs(name, trunk):
    """Plug-in Gait's legs have a preset of their own."""
    preset = read_marker_set(name)
    parts = ("pelvis", "thigh", "shank", "foot", *(["torso"] if trunk else []))
    legs = [
        label
        for segment, labels_of_segment in preset.segments.items()
        if segment.startswith(parts)
        for label in labels_of_segment
    ]
    expected = "plug-in-gait-lower-body" if name == "plug-in-gait" and not trunk else name
    assert choose_marker_set(legs) == read_marker_set(expected)
    with pytest.raises(MarkerSetError):
        choose_marker_set([label for label in preset.labels if label not in preset.segments["pelvis"]][::2])


@pytest.mark.parametrize("name", preset_names())
def test_presets_are_symmetric_and_put_every_marker_on_one_segment(name):
    preset = read_marker_set(name)
    tracked = [label for labels in preset.segments.values() for label in labels]
    assert len(tracked) == len(set(tracked))
    for entries in (preset.landmarks, preset.widths):
        for key in entries:
            if key.endswith("_r"):
                assert key[:-2] + "_l" in entries
    assert set(preset.foot_labels()) == {"r", "l"}


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_is_recognised_in_other_capitals_and_punctuation(name):
    preset = read_marker_set(name)
    written = {label: label.replace("_", ".").swapcase() for label in preset.labels}
    chosen = choose_marker_set(list(written.values()))
    assert chosen.landmarks == {
        key: tuple(written[label] for label in entry) for key, entry in preset.landmarks.items()
    }
    assert chosen.segments == {key: tuple(written[label] for label in entry) for key, entry in preset.segments.items()}
    assert chosen.widths == preset.widths
    assert chosen.name == preset.name
    assert chosen.respelled == {label: spelled for label, spelled in written.items() if label != spelled}


@pytest.mark.parametrize("name", preset_names())
@pytest.mark.parametrize("prefix", ["Anna_", "Anna-", "Anna.", "Anna ", "S-01_walk-"])
def test_a_preset_is_recognised_behind_a_name_that_all_labels_begin_with(name, prefix):
    preset = read_marker_set(name)
    labels = [prefix + label for label in preset.labels]
    chosen = choose_marker_set([*labels, "wand"])
    assert chosen.name == preset.name
    assert chosen.respelled == dict(zip(preset.labels, labels, strict=True))
    with pytest.raises(MarkerSetError):
        choose_marker_set([*labels, *(f"Ben_{label}" for label in preset.labels)])


def test_a_spelling_that_could_be_two_labels_is_nobodys():
    preset = read_marker_set("rajagopal")
    labels = [label for label in preset.labels if label != "R.Toe"]
    assert choose_marker_set([*labels, "R_Toe"]).landmarks["toe_r"] == ("R_Toe",)
    assert choose_marker_set([*labels, "R_Toe", "RTOE"]) == preset
    assert choose_marker_set([*labels, "R.Toe", "R_Toe"]) == preset


@pytest.mark.parametrize("name", ["cgm2", "plug-in-gait", "plug-in-gait-lower-body"])
@pytest.mark.parametrize("sacrum", ["SACR", "sacr", "VSAC", "V.Sacral", "Sacrum"])
def test_plug_in_gait_has_a_sacral_marker_or_the_psis(name, sacrum):
    preset = read_marker_set(name)
    labels = [label for label in preset.labels if label not in ("RPSI", "LPSI", "SACR")]
    chosen = choose_marker_set([*labels, sacrum])
    assert chosen.name == preset.name
    assert chosen.landmarks["sacrum"] == (sacrum,)
    assert chosen.segments["pelvis"] == ("RASI", "LASI", sacrum)
    assert chosen.respelled == ({} if sacrum == "SACR" else {"SACR": sacrum})
    psis = choose_marker_set([*labels, "RPSI", "LPSI"])
    assert psis.segments["pelvis"] == ("RASI", "LASI", "RPSI", "LPSI")
    assert "sacrum" not in psis.landmarks


def test_another_name_of_a_marker_is_taken_where_no_other_label_comes_into_question():
    preset = read_marker_set("plug-in-gait")
    labels = [label for label in preset.labels if label not in ("RPSI", "LPSI", "SACR")]
    assert choose_marker_set([*labels, "VSAC", "sacr"]).landmarks["sacrum"] == ("sacr",)
    assert "sacrum" not in choose_marker_set([*labels, "VSAC", "SACRUM"]).landmarks


@pytest.mark.parametrize(("off_m", "kept"), [(0.0, False), (0.003, True)])
def test_a_computed_sacral_marker_is_no_measured_one(off_m, kept):
    """Where all three are measured none is dropped."""
    preset = read_marker_set("plug-in-gait-lower-body")
    places = np.random.default_rng(1).normal(size=(5, len(preset.labels), 3))
    sacrum, *psis = (preset.labels.index(label) for label in ("SACR", "RPSI", "LPSI"))
    places[:, sacrum] = places[:, psis].mean(axis=1) + off_m
    chosen = marker_set_of(Markers(np.arange(5) / 100, preset.labels, places))
    assert chosen.segments["pelvis"] == ("RASI", "LASI", "RPSI", "LPSI", *(["SACR"] if kept else []))


OWN = {
    "field/unipd/walking1.c3d": None,
    "c3d_variety/ist.c3d": None,
    "c3d_variety/motion_analysis_walk.c3d": "Helen Hayes",
    "field/biomechzoo/HC030A/static.c3d": "Plug-in Gait",
}


@pytest.mark.parametrize("path", here(OWN))
def test_one_limit_for_presets_and_named_sets(recording_of, path):
    """Two thirds: a laboratory's version of a set is taken for it, labels that mean something else are not (D21).

    Nor are those of a set with other feet.
    """
    labels = recording_of(path).without_empty_markers().markers.labels
    if OWN[path] is None:
        with pytest.raises(MarkerSetError):
            choose_marker_set(labels)
        with pytest.raises(MarkerSetError):
            check_marker_set(read_marker_set("plug-in-gait-lower-body"), labels)
    else:
        assert choose_marker_set(labels).name == OWN[path]
        check_marker_set(choose_marker_set(labels), labels)


def test_nearest_labels_ignore_case_and_punctuation():
    assert nearest_labels(["R.ASIS"], ["LHEE", "rasis", "r_knee"])["R.ASIS"][0] == "rasis"
    assert nearest_labels(["C7"], ["XYZQ"]) == {"C7": []}


def test_a_users_own_set(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(SMALL)
    mine = read_marker_set(path)
    assert mine.landmarks == {"asis_r": ("RA",), "asis_l": ("LA", "LB")}
    assert mine.segments["torso"] == ()
    assert mine.labels == ("RA", "LA", "LB")


@pytest.mark.parametrize(
    ("change", "line", "code", "evidence"),
    [
        (("asis_r", "asis_rr"), 4, "F186", {"problem": "[landmarks] entry 'asis_rr'; the nearest is asis_r"}),
        (("pelvis =", "hips ="), 7, "F186", {"problem": "[segments] entry 'hips'; known are"}),
        (('"RA", "LA", "LB"]', '"RA", "LA"]'), 7, "F186", {"problem": "at least three markers"}),
        (('"RA"\nasis_l', "3\nasis_l"), 4, "F186", {"problem": "a label or a list of labels, not 3"}),
        (("[landmarks]", "[landmark]"), 3, "F186", {"problem": "unknown entry 'landmark'"}),
        (("[landmarks]\n", "landmarks = 3\n[widths]\n"), 3, "F186", {"problem": "must be a table"}),
        (('name = "mine"', "name = mine"), 2, "F103", {"kind": "TOML"}),
        (('asis_r = "RA"\n', ""), 3, "F186", {"problem": "[landmarks] lacks asis_r"}),
    ],
)
def test_a_broken_set_says_what_and_where(tmp_path, change, line, code, evidence):
    path = tmp_path / "mine.toml"
    assert change[0] in SMALL
    path.write_text(SMALL.replace(*change))
    with refused(code, line, **evidence):
        read_marker_set(path)


def test_an_error_names_the_line_of_the_key_itself_not_of_one_that_begins_like_it(tmp_path):
    """`heel_r` stands in a landmark's line, and a segment called `heel` further down."""
    path = tmp_path / "mine.toml"
    path.write_text(SMALL.replace("[segments]", 'heel_r = "HR"\n[segments]') + 'heel = ["HR"]\n')
    with refused("F186", 9, problem="[segments] entry 'heel'"):
        read_marker_set(path)


def test_the_same_key_in_two_tables_is_told_apart(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(SMALL + '[widths]\npelvis = "P"\n')
    with refused("F186", 9, problem="[widths] entry 'pelvis'"):
        read_marker_set(path)


def test_an_unknown_preset_lists_those_that_exist():
    with refused(
        "F101", None, hint="cgm2, cleveland-clinic, helen-hayes, ior-lower-body, opencap, opencap-mocap, plug-in-gait"
    ):
        read_marker_set("hayes")


@pytest.mark.parametrize(
    ("codes", "side", "expected"),
    [
        ("van-sint-jan-lower-body", "{}", "RCAJ"),
        ("qualisys-lower-body", "{}_", "R_SAE"),
        ("ior-lower-body", None, "RA"),
    ],
)
def test_landmark_codes_are_told_by_their_labels(codes, side, expected):
    """As https://wiki.has-motion.com (IOR Gait Full Body Model) lists them, with and without an underscore."""
    bones = {
        "van": ["IAS", "IPS", "FTC", "FLE", "FME", "FAX", "TTC", "FAL", "TAM", "FCC", "FM1", "FM2", "FM5"],
        "ior": ["ASIS", "PSIS", "GT", "LE", "ME", "HF", "TT", "LM", "MM", "CA", "FM", "SM", "VM"],
    }["ior" if side is None else "van"]
    before = "{}" if side is None else side
    trunk = ["C7", "IJ", "PX"] if side is None else ["CV7", "SJN", "SXS"]
    labels = [before.format(letter) + bone for letter in "RL" for bone in bones] + trunk
    chosen = choose_marker_set(labels)
    assert chosen == read_marker_set(codes)
    assert chosen.landmarks["acromion_r"] == (expected,)
    assert set(labels) <= set(chosen.labels)


def test_a_preset_is_not_taken_where_both_feet_lack_a_landmark():
    """One hidden marker is an error of its own, which names the landmark."""
    preset = read_marker_set("plug-in-gait")
    with pytest.raises(MarkerSetError) as error:
        choose_marker_set([label for label in preset.labels if label not in ("RTOE", "LTOE")])
    assert error.value.finding.code == "L101"
    assert choose_marker_set([label for label in preset.labels if label != "RTOE"]).name == preset.name
