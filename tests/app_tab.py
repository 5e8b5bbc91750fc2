"""A tab of the browser on `kinertia app`: what a user does there, and what went wrong in it."""

import json
import shutil
from urllib.parse import urlsplit

from chromium import DESKTOP, PATIENCE_MS, playwright
from found import FAULTY
from kinertia.findings.overview import Overview
from kinertia.io.output_folder import complete_folder
from kinertia.io.subject.provenance import sha256
from kinertia.report.pages.finding_view import digest


class Tab:
    """A tab of the browser, with what went wrong in it and where its requests went."""

    def __init__(self, browser, app, viewport=None):
        self.app = app
        self.page = browser.new_page(viewport=viewport or DESKTOP)
        self.page.set_default_timeout(PATIENCE_MS)
        self.errors, self.hosts = [], set()
        self.page.on("console", lambda message: message.type in ("error", "warning") and self.heard(message.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("requestfailed", self.failed)
        self.page.on("response", self.answered)
        self.page.on("request", lambda request: self.hosts.add(urlsplit(request.url).netloc))

    def heard(self, text):
        """What Chromium itself says of an answer to wrong input is no error of the page's."""
        if "422 (Unprocessable Entity)" not in text:
            self.errors.append(text)

    def answered(self, response):
        """Whatever is asked for is there; wrong input alone is answered with an error."""
        if response.status >= 400 and response.status != 422:
            self.errors.append(f"{response.status}: {response.url}")

    def failed(self, request):
        """What is asked for is answered, but for what is given up by going to another page, and files to save."""
        if request.failure != "net::ERR_ABORTED":
            self.errors.append(f"{request.failure}: {request.url}")

    def home(self):
        self.page.goto(self.app.address)
        return self

    def drop(self, *files):
        """Files for somebody new, who is called as the first of them or, of a folder, as it."""
        chosen = self.page.get_by_label("Choose a folder" if files[0].is_dir() else "Choose files")
        chosen.set_input_files([str(file) for file in files] if not files[0].is_dir() else str(files[0]))
        return self

    def drag(self, *paths):
        """The same by dragging files and folders from outside over the page, and letting them go there."""
        box = self.page.locator("[data-drop]").first.bounding_box()
        at = {"x": box["x"] + 40, "y": box["y"] + 40}
        data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
        session = self.page.context.new_cdp_session(self.page)
        for kind in ("dragEnter", "dragOver", "drop"):
            session.send("Input.dispatchDragEvent", {"type": kind, **at, "data": data})
        session.detach()
        return self

    def arrived(self):
        self.page.wait_for_url("**/people/*")
        playwright.expect(self.page.get_by_role("heading", name="1. Files and person")).to_be_visible()
        return self

    def fill(self, **entries):
        for label, value in entries.items():
            field = self.page.get_by_label({"sex": "Sex", "mass": "Body mass (kg)", "height": "Height (m)"}[label])
            field.select_option(value) if label == "sex" else field.fill(value)
        return self

    def check(self):
        self.page.get_by_role("button", name="Save and check").click()
        return self

    def text(self, changed):
        """Change the text of the subject file."""
        self.page.get_by_text("The subject file, with all entries").click()
        field = self.page.get_by_label("Subject file", exact=True)
        field.fill(changed(field.input_value()))
        self.page.get_by_role("button", name="Save this text and check").click()
        return self

    def checked(self):
        playwright.expect(self.page.locator(".outlook .headline")).to_be_visible()
        playwright.expect(self.page.locator("[data-progress]")).to_have_count(0)
        return self

    def estimate(self):
        self.page.get_by_role("button", name="Estimate", exact=True).click()
        return self

    def verdict(self):
        """The headline on the page, which the report inside it has as well."""
        playwright.expect(self.page.get_by_role("link", name="Letter, to print")).to_be_visible()
        headline = self.page.locator(".headline")
        playwright.expect(headline).to_be_visible()
        report = self.page.frame_locator("iframe.report").locator("#verdict .headline, .headline").first
        playwright.expect(report).to_have_text(headline.inner_text())
        playwright.expect(report).to_be_hidden()
        return headline.inner_text()

    def person(self):
        name = self.page.get_by_role("heading", level=1).inner_text()
        return self.app.library.person(name)

    def message(self):
        return self.page.locator(".message.error").first.inner_text()

    def quiet(self):
        assert self.errors == []
        assert self.hosts == {urlsplit(self.app.address).netloc}
        self.page.close()


def folder_of(path, lab):
    """A new folder with a laboratory's static trial and walk."""
    path.mkdir()
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(lab / name, path / name)
    return path


def ready(library, name, lab):
    """Somebody who can be fitted, with files of a laboratory's folder."""
    person = library.add(name)
    for path in (*lab.glob("*.c3d"), lab / "subject.toml"):
        shutil.copyfile(path, person.folder / path.name)
    return person


def with_everything(library, name, lab):
    """Somebody ready who has findings and results, too, without computing any."""
    person = ready(library, name, lab)
    overview = Overview(FAULTY, 61, 2, ("walk 2",))
    outcome = {"inputs": "", **digest(overview, {})}
    with complete_folder(person.check, "app") as work:
        (work / "outcome.json").write_text(json.dumps(outcome))
    person.results.mkdir()
    (person.results / "fit.json").write_text("{}")
    page = "<!doctype html><html lang=en><title>report</title><main><h1>report</h1></main>"
    (person.results / "report.html").write_text(page)
    outcome = {**outcome, "ended": 1.7e9}
    outcome["summary"] = sha256(person.results / "fit.json")
    (person.results / "outcome.json").write_text(json.dumps(outcome))
    return person
