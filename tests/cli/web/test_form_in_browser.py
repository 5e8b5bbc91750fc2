"""The form of a person in a browser: what is entered, kept, sent, and said of it in place."""

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_tab import folder_of
from chromium import playwright
from kinertia.io.subject.reader import read_subject

pytestmark = pytest.mark.slow


def test_a_measured_segment_and_a_rucksack_are_entered_in_the_form(tab, c3d_lab):
    tab.drop(c3d_lab / "walk.c3d", c3d_lab / "static.c3d").arrived().fill(sex="male", mass="72.6", height="1.803")
    page = tab.page
    page.get_by_text("Segments that were measured").click()
    page.get_by_label("Segment", exact=True).first.fill("thigh_r")
    page.locator("[name='segment:0:mass_kg']").fill("4,9")
    page.get_by_label("Marker set").select_option("plug-in-gait")
    page.get_by_label("Population").select_option("child")
    page.get_by_label("Age (years)").fill("11")
    tab.check()
    assert 'like "8.9 +- 0.4"' in tab.message()
    page.locator("[name='segment:0:mass_kg']").fill("4,9 +- 0,4")
    page.get_by_text("What is worn or carried").click()
    for name, text in (("name", "rucksack"), ("segment", "torso"), ("mass_kg", "unknown"), ("com_mm", "-150 250 0")):
        page.locator(f"[name='attached:0:{name}']").fill(text)
    page.get_by_label("On the scale, too").first.select_option("no")
    tab.check().checked()
    wanted = read_subject(tab.person().subject)
    assert (wanted.subject.age_years, wanted.subject.population) == (11.0, "child")
    assert wanted.model.markers == "plug-in-gait"
    assert wanted.segments["thigh_r"].mass_kg == (4.9, 0.4)
    assert wanted.attached[0].mass_kg is None
    tab.quiet()


def test_what_was_entered_is_kept_when_files_come_or_go_and_on_other_pages(tab, tmp_path, c3d_lab):
    folder = folder_of(tmp_path / "Anna", c3d_lab)
    (folder / "list.csv").write_text("a,b\n1,2\n")
    tab.drop(folder).arrived()
    tab.fill(sex="male", mass="41,5")
    tab.page.get_by_role("button", name="Remove list.csv").click()
    playwright.expect(tab.page.get_by_text("list.csv")).to_have_count(0)
    sex, mass = tab.page.get_by_label("Sex"), tab.page.get_by_label("Body mass (kg)")
    playwright.expect(sex).to_have_value("male")
    playwright.expect(mass).to_have_value("41.5")
    mass.fill("42")
    tab.page.get_by_text("Add files").click()
    tab.page.get_by_label("Choose files").set_input_files(
        {"name": "other.csv", "mimeType": "text/csv", "buffer": b"a,b\n1,2\n"}
    )
    playwright.expect(tab.page.get_by_role("button", name="Remove other.csv")).to_be_visible()
    playwright.expect(mass).to_have_value("42.0")
    mass.fill("43")
    tab.page.get_by_role("link", name="Markers", exact=True).click()
    tab.page.wait_for_url("**/markers")
    tab.page.go_back()
    tab.page.reload()
    playwright.expect(mass).to_have_value("43.0")
    mass.fill("heavy")
    tab.page.get_by_role("button", name="Remove other.csv").click()
    playwright.expect(tab.page.locator(".message.error")).to_contain_text("heavy")
    playwright.expect(mass).to_have_value("heavy")
    playwright.expect(tab.page.get_by_role("button", name="Remove other.csv")).to_be_visible()
    tab.quiet()


def test_a_form_in_which_nobody_typed_is_not_sent(tab, c3d_lab):
    """What the page came with is compared with what stands there, in fields of every kind."""
    tab.drop(c3d_lab / "walk.c3d", c3d_lab / "static.c3d").arrived()
    kept = []
    tab.page.on("request", lambda request: request.url.endswith("/keep") and kept.append(request.url))
    tab.page.reload()
    tab.page.get_by_role("link", name="Markers", exact=True).click()
    tab.page.wait_for_url("**/markers")
    assert not kept
    tab.page.go_back()
    tab.page.reload()
    tab.page.get_by_label("Height (m)").fill("1.7")
    tab.page.get_by_role("link", name="Markers", exact=True).click()
    tab.page.wait_for_url("**/markers")
    assert len(kept) == 1
    tab.quiet()


def test_a_wrong_mass_is_said_in_place(tab, c3d_lab):
    tab.drop(c3d_lab / "walk.c3d", c3d_lab / "static.c3d").arrived().fill(
        sex="male", mass="7260", height="1.803"
    ).check()
    assert "S102" in tab.message()
    assert tab.page.get_by_role("button", name="Estimate", exact=True).count() == 0
    tab.fill(mass="heavy").check()
    assert "'heavy' is not a number; write it like 72.6" in tab.message()
    assert tab.page.get_by_label("Body mass (kg)").input_value() == "heavy"
    tab.fill(mass="70").check().checked()
    found = tab.page.locator(".findings")
    playwright.expect(found).to_contain_text("S103")
    tab.quiet()


def test_a_static_trial_may_be_missing(tab, c3d_lab):
    tab.drop(c3d_lab / "walk.c3d").arrived().fill(sex="male", mass="72.6", height="1.803").check().checked()
    playwright.expect(tab.page.get_by_role("button", name="Estimate", exact=True)).to_be_visible()
    tab.quiet()


def test_a_file_that_is_no_motion_is_said_in_place(tab, tmp_path, c3d_lab):
    (tmp_path / "broken.c3d").write_bytes(b"this is no motion" * 100)
    tab.drop(tmp_path / "broken.c3d", c3d_lab / "static.c3d").arrived()
    tab.fill(sex="male", mass="72.6", height="1.803").check()
    playwright.expect(tab.page.locator(".message.error")).to_contain_text("F103")
    assert "broken.c3d" in tab.message()
    tab.quiet()
