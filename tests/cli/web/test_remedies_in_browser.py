"""Remedies of findings in a browser: a button writes the setting, shows it, checks again, and can be undone."""

import json
import shutil

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_tab import ready
from chromium import playwright
from kinertia.findings.finding import finding
from kinertia.findings.overview import Overview
from kinertia.findings.quantity import Where
from kinertia.io.output_folder import complete_folder
from kinertia.io.subject.reader import read_subject
from kinertia.report.pages.finding_view import digest

pytestmark = pytest.mark.slow


def opened(tab, person):
    tab.page.goto(f"{tab.app.address}people/{person.name}".replace(" ", "%20"))
    return tab.page


def codes(page):
    return page.locator(".findings a").all_inner_texts()


def test_the_mass_is_corrected_to_what_the_plates_show_and_that_is_undone(tab, app, c3d_lab):
    person = ready(app.library, "Weighed wrongly", c3d_lab)
    page = opened(tab, person)
    tab.fill(mass="60").check().checked()
    assert "S111" in codes(page)
    page.get_by_role("button", name="Set body mass (kg) to").click()
    playwright.expect(page.locator(".applied code")).to_contain_text("mass_kg = 7")
    tab.checked()
    assert "S111" not in codes(page)
    assert read_subject(person.subject).subject.mass_kg == pytest.approx(72.6, abs=1.0)
    page.get_by_role("button", name="Undo mass_kg").click()
    playwright.expect(page.locator(".applied")).to_have_count(0)
    tab.checked()
    assert "S111" in codes(page)
    playwright.expect(page.get_by_label("Body mass (kg)")).to_have_value("60.0")
    tab.quiet()


def test_an_error_is_waived_with_a_reason_only(tab, app, c3d_lab):
    person = ready(app.library, "Waived", c3d_lab)
    page = opened(tab, person)
    tab.fill(mass="60").check().checked()
    page.get_by_text("Waive it, with a reason").click()
    button = page.get_by_role("button", name="Waive", exact=True)
    button.click()
    assert page.locator(".applied").count() == 0, "the browser asks for the reason"
    page.get_by_label("Reason").first.fill("weighed without the boots")
    button.click()
    playwright.expect(page.locator(".applied")).to_contain_text("weighed without the boots")
    tab.checked()
    playwright.expect(page.locator(".findings .error")).to_contain_text("weighed without the boots")
    overrule = read_subject(person.subject).trials[0].diagnostics.overrule
    assert (overrule.waive, overrule.reason("S111")) == (("S111",), "weighed without the boots")
    tab.quiet()


FOUND = {
    "Leave LTOE out of walk 2": finding("M113", Where(trial="walk 2", markers=("LTOE",))),
    "Use 0.7 to 1.1 s of walk 2 only": finding("P276", Where(trial="walk 2", plate="plate 1", span_s=(0.3, 0.7))),
    "Leave out walk 2": finding("P103", Where(trial="walk 2", plate="plate 1")),
    "Do without the static trial": finding("S202", Where(trial="static")),
}


def test_trials_steps_markers_and_the_static_trial_are_left_out(tab, app, c3d_lab):
    person = ready(app.library, "Two walks", c3d_lab)
    shutil.copyfile(c3d_lab / "walk.c3d", person.folder / "walk 2.c3d")
    two = person.subject.read_text() + '\n[[trial]]\nmarkers = "walk 2.c3d"\n'
    written = {}
    for label, found in FOUND.items():
        person.subject.write_text(two)
        fresh = app.library.person(person.name)
        shown = digest(Overview((found,), 61, 2), {"walk": [(0.4, 1.1)], "walk 2": [(0.4, 1.1)]})
        with complete_folder(person.check, "app") as work:
            (work / "outcome.json").write_text(json.dumps({"inputs": fresh.inputs, **shown}))
        page = opened(tab, person)
        page.get_by_role("button", name=label).click()
        playwright.expect(page.locator(".applied li").last).to_be_visible()
        tab.checked()
        written[label] = read_subject(person.subject)
    marker, window, trial, static = written.values()
    assert marker.trials[1].leave_out == ("LTOE",)
    assert window.trials[1].window_s == (0.7, 1.1)
    assert [listed.name for listed in trial.trials] == ["walk"]
    assert static.model.static is None
    tab.quiet()


def test_a_part_of_a_recording_is_chosen_in_the_table(tab, app, c3d_lab):
    person = ready(app.library, "Part", c3d_lab)
    page = opened(tab, person)
    page.get_by_label("Use walk.c3d from (s)").fill("0,5")
    tab.check()
    assert "walk.c3d" in tab.message()
    page.get_by_label("Use walk.c3d to (s)").fill("1.0")
    tab.check().checked()
    assert read_subject(person.subject).trials[0].window_s == (0.5, 1.0)
    tab.quiet()
