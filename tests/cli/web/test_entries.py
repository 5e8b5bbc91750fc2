"""From files to a subject file and back: the draft, the table of files, the form, the text."""

import shutil
import tomllib

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")

from command_line import run
from kinertia.cli.web.entries import USE, entries, fields, marker_set_field, recognise, trouble, write_form, write_text
from kinertia.cli.web.file_table import file_table, uses_of, with_uses, within_folder
from kinertia.cli.web.library import Library
from kinertia.errors import FileError, SettingsError
from kinertia.io.marker_set_file import preset_names
from kinertia.io.subject.body_files import measures_sheet
from kinertia.io.subject.reader import read_subject
from kinertia.settings import Subject


@pytest.fixture
def person(tmp_path):
    return Library(tmp_path / "library").add("Anna")


def put(person, folder, *names):
    for name in names:
        shutil.copyfile(folder / name, person.folder / name)


def used(person):
    return {row.name: row.use for row in file_table(person.files(), entries(person)) if row.use}


GAIT2354 = ("subject01_static.trc", "subject01_walk1.trc", "subject01_walk1_grf.mot", "subject01_walk1_grf.xml")
LAB = ("static.trc", "walk.trc", "walk_grf.mot", "walk_grf.xml")


def test_c3d_files_are_recognised_and_what_lacks_is_said_as_by_the_command_line(person, c3d_lab):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    assert used(person) == {"static.c3d": "static", "walk.c3d": "trial"}
    assert "[subject] lacks 'sex'" in trouble(person)
    assert trouble(person) in " ".join(run("fit", person.subject, "-o", person.results).err.split())
    write_form(person, {"sex": "male", "mass_kg": "41,5", "height_m": "1.61"})
    assert trouble(person) == ""
    wanted = read_subject(person.subject)
    assert (wanted.subject.mass_kg, wanted.subject.height_m, wanted.subject.sex) == (41.5, 1.61, "male")
    assert wanted.subject.name == "Anna"


def test_forces_and_loads_go_with_their_walk(person, sample_walk):
    put(person, sample_walk / "gait2354", *GAIT2354)
    recognise(person)
    walk = "subject01_walk1.trc"
    assert used(person) == dict(zip(GAIT2354, ("static", "trial", f"forces:{walk}", f"loads:{walk}"), strict=True))


def test_a_model_takes_the_place_of_a_static_trial_that_is_not_there(person, synthetic_lab):
    put(person, synthetic_lab, *LAB[1:], "scaled.osim")
    recognise(person)
    walk = "walk.trc"
    assert used(person) == {walk: "trial", "walk_grf.mot": f"forces:{walk}", "walk_grf.xml": f"loads:{walk}"} | {
        "scaled.osim": "osim"
    }
    write_form(person, {"mass_kg": "72.6"})
    assert trouble(person) == ""


def test_a_model_that_is_chosen_puts_the_static_trial_aside(person, synthetic_lab):
    put(person, synthetic_lab, *LAB, "scaled.osim")
    recognise(person)
    assert used(person)["static.trc"] == "static"
    assert "scaled.osim" not in used(person)
    write_form(person, {USE + "scaled.osim": "osim", "mass_kg": "72.6"})
    assert used(person)["scaled.osim"] == "osim"
    assert "static.trc" not in used(person)
    assert trouble(person) == ""
    write_form(person, {USE + "scaled.osim": "", USE + "static.trc": "static", "sex": "male"})
    assert used(person)["static.trc"] == "static"
    assert trouble(person) == ""


def test_a_trial_that_is_used_again_has_its_forces_loads_and_window_again(person, sample_walk):
    put(person, sample_walk / "gait2354", *GAIT2354)
    recognise(person)
    static, walk, forces, _ = GAIT2354
    text = person.subject.read_text(encoding="utf-8")
    marked = next(line for line in text.splitlines() if line.startswith("markers") and walk in line)
    write_text(person, text.replace(marked, f"{marked}\nwindow_s = [0.5, 1.0]"))
    before, trial = used(person), entries(person)["trial"]

    def saved(**changed):
        """As the form does: every file with its use, as shown or changed."""
        rows = file_table(person.files(), entries(person))
        write_form(person, {USE + row.name: changed.get(row.name, row.use) for row in rows if row.choices})

    saved(**{walk: ""})
    assert used(person) == {static: "static"}
    saved()
    saved(**{walk: "trial"})
    assert used(person) == before
    assert entries(person)["trial"] == trial
    saved(**{forces: ""})
    assert used(person) == {name: use for name, use in before.items() if name != forces}, "what is put aside stays so"
    saved(**{walk: ""})
    saved(**{walk: "trial"})
    assert forces not in used(person)


def test_forces_that_were_chosen_since_go_before_those_that_a_trial_had(person, sample_walk):
    put(person, sample_walk / "gait2354", *GAIT2354)
    recognise(person)
    static, walk, forces, _ = GAIT2354
    shutil.copyfile(person.folder / forces, person.folder / "other_grf.mot")
    write_form(person, {USE + walk: "", USE + static: "static"})
    write_form(person, {USE + walk: "trial", USE + "other_grf.mot": f"forces:{walk}"})
    assert used(person)["other_grf.mot"] == f"forces:{walk}"
    assert forces not in used(person)


def test_forces_of_a_static_trial_are_said_to_be_that(person, synthetic_lab):
    for source, name in (("static.trc", "static1.trc"), ("walk_grf.mot", "static1_grf.mot")):
        shutil.copyfile(synthetic_lab / source, person.folder / name)
    recognise(person)
    (row,) = [row for row in file_table(person.files(), entries(person)) if row.name == "static1_grf.mot"]
    assert row.kind == "forces of a static trial, by its name: not needed (only its markers are used)"
    assert row.use == ""


def test_forces_of_another_person_are_not_taken(tmp_path, sample_walk):
    library = Library(tmp_path)
    anna, ben = library.add("Anna"), library.add("Ben")
    put(anna, sample_walk / "gait2354", *GAIT2354[:2])
    put(ben, sample_walk / "gait2354", *GAIT2354[2:])
    recognise(anna)
    assert used(anna) == {GAIT2354[0]: "static", GAIT2354[1]: "trial"}


def test_what_was_corrected_stays_when_files_are_added_or_removed(person, c3d_lab):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    write_form(person, {"sex": "female", "mass_kg": "50", USE + "walk.c3d": "", USE + "static.c3d": "static"})
    shutil.copyfile(c3d_lab / "static.c3d", person.folder / "walk2.c3d")
    recognise(person)
    assert used(person) == {"static.c3d": "static", "walk2.c3d": "trial"}
    assert entries(person)["subject"]["mass_kg"] == 50.0
    (person.folder / "walk2.c3d").unlink()
    recognise(person)
    assert used(person) == {"static.c3d": "static"}
    assert "trial" in trouble(person)


def test_a_sheet_of_measures_is_used_until_it_is_put_aside(person, c3d_lab):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    write_form(person, {"sex": "male"})
    (person.folder / "measures.csv").write_text(measures_sheet(), encoding="utf-8")
    recognise(person)
    assert used(person) == {"static.c3d": "static", "walk.c3d": "trial", "measures.csv": "measures"}
    assert read_subject(person.subject).prior.measures == (person.folder / "measures.csv").resolve()
    (row,) = [row for row in file_table(person.files(), entries(person)) if row.name == "measures.csv"]
    assert row.kind == "girths and lengths of the person"
    write_form(person, {USE + "measures.csv": ""})
    assert read_subject(person.subject).prior.measures is None
    recognise(person)
    assert "measures.csv" not in used(person), "what was put aside stays so"


def test_two_files_for_one_use_are_an_error(person, c3d_lab):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    before = person.subject.read_text(encoding="utf-8")
    with pytest.raises(SettingsError, match=r"static.c3d and walk.c3d are both used as static; choose one"):
        write_form(person, {USE + "walk.c3d": "static"})
    assert person.subject.read_text(encoding="utf-8") == before


@pytest.mark.parametrize("mass", ["4150", "-3"])
def test_an_impossible_mass_has_the_command_lines_message(person, c3d_lab, mass):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    write_form(person, {"sex": "male", "mass_kg": mass})
    assert "S102" in trouble(person)
    assert trouble(person) in " ".join(run("check", person.subject).err.split())


def test_what_is_no_number_is_said_and_nothing_is_written(person, c3d_lab):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    before = person.subject.read_text(encoding="utf-8")
    with pytest.raises(SettingsError, match=r"Body mass \(kg\): 'heavy' is not a number; write it like 72.6"):
        write_form(person, {"mass_kg": "heavy"})
    assert person.subject.read_text(encoding="utf-8") == before
    assert {field.key: field.value for field in fields(entries(person), {"mass_kg": "heavy"})}["mass_kg"] == "heavy"
    for text in ("1e400", "nan", "-inf"):
        with pytest.raises(SettingsError, match=rf"Body mass \(kg\): '{text}' is not a usable number"):
            write_form(person, {"mass_kg": text})
    assert person.subject.read_text(encoding="utf-8") == before


def test_a_subject_file_that_was_dropped_is_used_with_all_its_entries(person, c3d_lab):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    (person.folder / "anna spring.toml").write_text(
        '[subject]\nsex = "f"\nmass_kg = 50\nknee_width_mm = 100.0\n[model]\nstatic = "C:\\\\lab\\\\static.c3d"\n'
        '[[trial]]\nname = "second"\nmarkers = "../lab/walk.c3d"\nwindow_s = [2.8, 3.4]\n'
        '[settings]\ncutoff_hz = 6\n[segment.thigh_r]\nmass_kg = "8.9 +- 0.4"\nsource = "DXA, \\"spring\\""\n',
        encoding="utf-8",
    )
    recognise(person)
    assert trouble(person) == ""
    write_form(person, {"sex": "female", "mass_kg": "51", "knee_width_mm": "100"})
    wanted = read_subject(person.subject)
    assert wanted.trials[0].markers == (person.folder / "walk.c3d").resolve()
    assert (wanted.trials[0].name, wanted.trials[0].window_s) == ("second", (2.8, 3.4))
    assert wanted.settings.cutoff_hz == 6
    assert wanted.segments["thigh_r"].mass_kg == (8.9, 0.4)
    assert wanted.segments["thigh_r"].source == 'DXA, "spring"'
    assert (wanted.subject.mass_kg, wanted.subject.knee_width_mm) == (51.0, 100.0)


def test_no_file_outside_the_folder_is_read(person, tmp_path, c3d_lab):
    put(person, c3d_lab, "walk.c3d")
    outside = (tmp_path / "elsewhere.c3d").as_posix()
    shutil.copyfile(c3d_lab / "static.c3d", outside)
    write_text(person, f'[subject]\nsex="f"\n[model]\nstatic="{outside}"\n[[trial]]\nmarkers="walk.c3d"\n')
    assert "F101 " in trouble(person)
    within = within_folder(
        {
            "model": {"osim": "C:b.osim", "markers": "/a/set.toml"},
            "prior": {"bsp": "../bsp.csv", "population": "~/group.toml"},
            "instruments": {"session": "\\\\server\\s.toml"},
            "trial": [{"forces": "x/y.mot", "loads": "~/z.xml", "markers": "w.trc"}],
        }
    )
    assert within["model"] == {"osim": "b.osim", "markers": "set.toml"}
    assert (within["prior"], within["instruments"]) == (
        {"bsp": "bsp.csv", "population": "group.toml"},
        {"session": "s.toml"},
    )
    assert within["trial"] == [{"forces": "y.mot", "loads": "z.xml", "markers": "w.trc"}]


def test_text_that_is_not_toml_changes_nothing(person):
    write_text(person, '[subject]\r\nsex = "f"\r\n')
    with pytest.raises(FileError, match="line 2: F103 "):
        write_text(person, "[subject]\nsex = f\n")
    assert person.subject.read_text(encoding="utf-8") == '[subject]\nsex = "f"\n'


def test_without_recordings_the_command_lines_message_is_raised(person):
    (person.folder / "notes.csv").write_text("a,b\n")
    with pytest.raises(FileError, match="holds no file of markers"):
        recognise(person)


def test_the_table_gives_the_entries_back():
    content = {
        "subject": {"sex": "male"},
        "model": {"static": "s.trc", "markers": "plug-in-gait", "length_unit": "mm"},
        "trial": [{"markers": "w.trc", "forces": "w.mot", "window_s": [1, 2]}, {"markers": "v.trc"}],
        "prior": {"bsp": "bsp.csv", "measures": "tape.csv", "masses_kept": True},
    }
    uses = {name: use for name, use in uses_of(content).items() if name != "plug-in-gait"}
    assert with_uses(content, uses) == content


def test_the_form_leaves_joint_ranges_as_they_are_in_the_text(person, c3d_lab):
    """They are a table: as a field of the form they could neither be typed nor kept."""
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    text = person.subject.read_text(encoding="utf-8")
    write_text(person, text.replace("[subject]", "[subject]\nranges_deg = { knee_angle_r = [-20, 150] }"))
    form = {field.key: field.value for field in fields(entries(person))}
    write_form(person, {**form, "sex": "female", "mass_kg": "41.5"})
    subject = read_subject(person.subject).subject
    assert (subject.mass_kg, tuple(subject.ranges_deg["knee_angle_r"])) == (41.5, (-20.0, 150.0))


def test_the_form_has_every_entry_of_the_person():
    shown = {field.key: field for field in fields({"subject": {"sex": "f", "age_years": 9.0}})}
    assert set(shown) == set(Subject.model_fields) - {"ranges_deg"}
    assert (shown["sex"].value, shown["sex"].choices) == ("female", ("male", "female"))
    assert shown["population"].choices == ("adult", "child", "elderly", "obese", "other")
    assert shown["age_years"].value == "9.0"
    assert not shown["mass_kg"].choices


def test_age_population_and_what_is_attached_reach_the_subject_file(person, c3d_lab):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    text = person.subject.read_text(encoding="utf-8")
    attached = '[[attached]]\nname = "rucksack"\nsegment = "torso"\nmass_kg = "8.0 +- 0.1"\n'
    write_text(person, text + attached)
    write_form(person, {"sex": "male", "mass_kg": "41.5", "age_years": "11,5", "population": "child"})
    content = entries(person)
    assert content["attached"] == [{"name": "rucksack", "segment": "torso", "mass_kg": "8.0 +- 0.1"}]
    wanted = tomllib.loads(person.subject.read_text(encoding="utf-8"))["subject"]
    assert (wanted["age_years"], wanted["population"]) == (11.5, "child")


def test_the_marker_set_is_chosen_among_the_presets(person, c3d_lab):
    put(person, c3d_lab, "static.c3d", "walk.c3d")
    recognise(person)
    field = marker_set_field(entries(person))
    assert field.choices == tuple(preset_names())
    write_form(person, {"marker_set": "plug-in-gait", "sex": "male"})
    assert read_subject(person.subject).model.markers == "plug-in-gait"
    assert marker_set_field(entries(person)).value == "plug-in-gait"
    write_form(person, {"marker_set": ""})
    assert read_subject(person.subject).model.markers is None
    assert marker_set_field({"model": {"markers": "own.toml"}}) is None
    assert marker_set_field({"model": {"osim": "scaled.osim"}}) is None
