"""The clinician's way through the page: from a dropped folder to the letter, by clicks that are counted."""

import json
import shutil

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")
from app_server import running
from app_tab import Tab, folder_of, with_everything
from chromium import playwright
from kinertia.io.subject.reader import read_subject

MOST_CLICKS = 10
COUNTED = """
addEventListener('click', (event) => count(event.isTrusted && !event.target.matches('input, select, label')), true);
addEventListener('input', () => count(true), true);
const count = (one) => one && (sessionStorage.acts = Number(sessionStorage.acts || 0) + 1);
"""
"""Counts each click on a button, link or heading, and each field that is filled in."""

pytestmark = pytest.mark.slow


def test_from_a_dropped_folder_to_the_letter_in_ten_clicks(tab, tmp_path, c3d_lab):
    page = tab.page
    page.add_init_script(COUNTED)
    page.reload()
    folder = folder_of(tmp_path / "Anna", c3d_lab)
    for companion in ("walk.Trial.enf", "walk.history", "Anna.vsk"):
        (folder / companion).write_text("of Nexus")
    tab.drag(folder).arrived()
    assert page.locator(".problems li").count() == 0
    assert page.locator(".message.error").count() == 0, "no error before anything was typed"
    assert "line " not in " ".join(page.locator(".message").all_inner_texts())
    tab.fill(sex="male", mass="72.6", height="1.803").check().checked()
    tab.estimate()
    letter = page.get_by_role("link", name="Letter, to print")
    playwright.expect(letter).to_be_visible(timeout=300_000)
    with page.context.expect_page() as opened:
        letter.click()
    written = opened.value
    playwright.expect(written.get_by_role("heading").first).to_be_visible()
    playwright.expect(written.locator("body")).to_contain_text("Joint moments")
    clicks = int(page.evaluate("sessionStorage.acts"))
    assert 6 <= clicks <= MOST_CLICKS - 1, "and one more to print"
    written.close()
    tab.page.close()


def test_a_condition_is_stated_beside_its_walk(tab, app, c3d_lab):
    person = with_everything(app.library, "With orthosis", c3d_lab)
    tab.page.goto(f"{app.address}people/{person.name}".replace(" ", "%20"))
    field = tab.page.get_by_label("Condition of walk.c3d")
    field.fill("with orthosis")
    tab.check().checked()
    assert [trial.condition for trial in read_subject(person.subject).trials] == ["with orthosis"]
    playwright.expect(field).to_have_value("with orthosis")
    field.fill("")
    tab.check().checked()
    assert [trial.condition for trial in read_subject(person.subject).trials] == [""]
    tab.quiet()


def test_norms_are_made_of_the_chosen_people_and_used_in_their_letter(browser, demo_run, fit_of, tmp_path):
    with running(tmp_path / "library") as server:
        for name, results in (("Control", demo_run[1]), ("Other", fit_of("synthetic").folder)):
            folder = server.library.add(name).results
            folder.mkdir()
            for file in ("fit.npz", "fit.json", "report.html"):
                shutil.copyfile(results / file, folder / file)
        tab = Tab(browser, server).home()
        assert not server.library.norms.exists()
        for name in ("Control", "Other"):
            tab.page.get_by_label(f"Compare {name}").check()
        tab.page.get_by_role("button", name="Make norms from the chosen").click()
        playwright.expect(tab.page.get_by_text("norms.csv of this folder")).to_be_visible()
        assert server.library.norms.read_text().startswith("quantity,percent,mean,sd")
        letter = server.ask("/people/Control/letter")
        assert letter.status == 200
        assert "Gait Profile Score" in letter.text
        assert "sandbox" in letter.headers["content-security-policy"]
        assert server.post("/people/Control/comparison", "before=shod&after=barefoot").status == 303
        while json.loads(server.ask("/people/Control/progress").text)["comparison"]:
            tab.page.wait_for_timeout(200)
        assert "shod" in server.library.person("Control").notes()["comparison"]["message"]
        tab.quiet()
