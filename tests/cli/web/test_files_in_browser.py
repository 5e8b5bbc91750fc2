"""The page in a browser: headless Chromium drops files on it and reads the verdict, as a user does."""

import re
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_server import running
from app_tab import Tab, folder_of
from chromium import playwright
from command_line import fitted
from kinertia.report.exports.saved_fit import load_fit

pytestmark = pytest.mark.slow


def test_plug_in_gait_from_dropping_to_the_verdict_and_as_on_the_command_line(tab, tmp_path, c3d_lab):
    folder = folder_of(tmp_path / "Subject A", c3d_lab)
    (folder / "letter.pdf").write_text("not for Kinertia")
    tab.drop(folder)
    playwright.expect(tab.page.locator(".problems")).to_contain_text("a '.pdf' file is none that Kinertia reads")
    tab.page.get_by_role("link", name="Go on").click()
    tab.arrived()
    assert tab.page.get_by_role("heading", level=1).inner_text() == "Subject A"
    playwright.expect(tab.page.locator(".message.warning")).to_contain_text("Sex is missing")
    tab.fill(sex="male", mass="72,6", height="1.803").check().checked()
    playwright.expect(tab.page.locator(".outlook .headline")).to_be_in_viewport()
    verdict = tab.estimate().verdict()
    theirs = load_fit(fitted(tmp_path / "out", c3d_lab / "subject.toml").folder)
    ours = load_fit(tab.person().results)
    assert (ours.estimate.table() == theirs.estimate.table()).all()
    assert verdict == ours.overview.line
    with tab.page.expect_download() as download:
        tab.page.get_by_role("link", name="Save all results (zip)").click()
    assert download.value.suggested_filename == "Subject A.zip"
    with tab.page.expect_download() as download:
        tab.page.get_by_text("The subject file, with all entries").click()
        tab.page.get_by_role("link", name="Save subject.toml").click()
    assert Path(download.value.path()).read_bytes() == tab.person().subject.read_bytes()
    tab.quiet()


def test_the_demos_laboratory_files_to_the_verdict(tab, demo_run):
    lab = demo_run[1] / "lab"
    tab.drop(
        *(path for path in sorted(lab.iterdir()) if path.suffix in (".trc", ".mot")), lab / "subject.toml"
    ).arrived()
    assert tab.page.get_by_label("static.trc is used as").input_value() == "static"
    tab.text(lambda text: re.sub(r"(markers = \"walk.trc\".*)", "\\1\nwindow_s = [1.1, 1.4]", text))
    tab.checked().estimate()
    tab.verdict()
    tab.quiet()


def test_a_walk_with_a_model_to_the_verdict(tab, measured_folder):
    files = ("motion_capture_walk.trc", "grf_walk.mot", "grf_walk.xml", "scaled.osim")
    tab.drop(*(measured_folder / "rajagopal_walk" / name for name in files)).arrived()
    assert tab.page.get_by_label("scaled.osim is used as").input_value() == "osim"
    text = "[subject]\nmass_kg = 85.0\n[model]\nosim = 'scaled.osim'\n[[trial]]\nmarkers = 'motion_capture_walk.trc'\n"
    text += "forces = 'grf_walk.mot'\nloads = 'grf_walk.xml'\nwindow_s = [0.85, 1.15]\n"
    tab.text(lambda _: text)
    tab.checked().estimate()
    tab.verdict()
    assert tab.person().results.joinpath("model_changes.csv").is_file()
    tab.quiet()


def test_a_folder_is_dragged_onto_the_page_and_an_archive_is_refused(tab, tmp_path, c3d_lab):
    tab.drag(folder_of(tmp_path / "Dragged", c3d_lab)).arrived()
    assert tab.page.get_by_role("heading", level=1).inner_text() == "Dragged"
    assert tab.page.get_by_label("static.c3d is used as").input_value() == "static"
    with zipfile.ZipFile(tmp_path / "session.zip", "w") as archive:
        archive.write(c3d_lab / "walk.c3d", "walk.c3d")
    tab.page.get_by_text("Add files").click()
    tab.drag(tmp_path / "session.zip")
    said = "session.zip: not accepted: archives are not unpacked here; unpack it and drop the folder"
    playwright.expect(tab.page.locator(".problems")).to_contain_text(said)
    tab.quiet()


def test_nobody_stays_in_the_library_of_whom_no_file_was_taken(browser, app, tmp_path):
    before = {person.name for person in app.library.people()}
    (tmp_path / "only.pdf").write_text("not for Kinertia")
    tab = Tab(browser, app).home().drop(tmp_path / "only.pdf")
    playwright.expect(tab.page.locator("[role=status]")).to_have_text("No file was taken.")
    playwright.expect(tab.page.locator(".problems")).to_contain_text("only.pdf: not accepted")
    assert {person.name for person in app.library.people()} == before
    tab.quiet()


@pytest.mark.parametrize(
    ("names", "person"),
    [
        (("subject04_static.trc", "subject04_walk_1.trc", "subject04_walk_2.trc"), "subject04"),
        (("Eva Berg static.trc", "Eva Berg walk.trc"), "Eva Berg"),
        (("standing.trc", "w1.trc", "carla.toml"), "carla"),
        (("static.trc", "w1.trc", "subject.toml"), "Person"),
        (("walk_1.trc", "walk_2.trc"), "Person"),
    ],
)
def test_a_person_is_called_as_the_files_are(browser, tmp_path, names, person):
    for name in names:
        (tmp_path / name).write_text("no markers")
    with running(tmp_path / "library") as server:
        tab = Tab(browser, server).home().drop(*(tmp_path / name for name in names)).arrived()
        assert tab.page.get_by_role("heading", level=1).inner_text() == person
        tab.quiet()
