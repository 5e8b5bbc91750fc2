"""What addresses answer besides pages to look at: comparison, zip, troubles, a person that is busy."""

import io
import json
import shutil
import zipfile
from urllib.parse import quote

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")

from app_server import running
from kinertia.cli.demo import write_measured_lab, write_synthetic_lab
from kinertia.cli.web import routes
from kinertia.cli.web.jobs import Jobs
from kinertia.errors import internal_error
from kinertia.io import samples
from kinertia.io.subject.body_files import measures_sheet
from kinertia.io.subject.provenance import sha256
from kinertia.io.subject.reader import read_subject
from kinertia.report.figures.measures_picture import measures_picture


@pytest.fixture
def app(tmp_path):
    with running(tmp_path / "library") as served:
        yield served


def with_results(app, name, folder):
    person = app.library.add(name)
    shutil.copytree(folder, person.results)
    return person


@pytest.mark.slow
def test_people_are_compared_as_on_the_command_line(app, measured_demo):
    for name in ("Anna", "Ben"):
        with_results(app, name, measured_demo.folder)
    page = app.ask("/compare?person=Anna&person=Ben")
    assert page.status == 200
    assert "Anna, Ben; the first is what the others are compared with" in " ".join(page.text.split())
    compared = app.ask("/compare/page?person=Anna&person=Ben")
    assert "Comparison: Anna, Ben" in compared.text
    assert "sandbox" in compared.headers["content-security-policy"]
    assert "written by the command line" in app.ask("/people/Anna").text


def test_the_sheet_of_measures_is_saved_as_the_command_line_writes_it(app, c3d_lab):
    person = app.library.add("Anna")
    shutil.copyfile(c3d_lab / "walk.c3d", person.folder / "walk.c3d")
    linked = app.ask("/people/Anna").text
    for name, content in (("measures.csv", measures_sheet()), ("measures.svg", measures_picture())):
        assert f'href="{app.root}/{name}" download' in linked
        assert app.ask(f"/{name}").text == content


def test_who_has_no_results_is_not_compared(app):
    app.library.add("Anna")
    assert "Choose 2 to" in app.ask("/compare?person=Anna&person=Anna").text
    assert app.ask("/compare/page?person=Anna&person=../Anna").status == 404


def test_the_zip_has_all_results_under_the_persons_name(app, tmp_path):
    (tmp_path / "results" / "walk").mkdir(parents=True)
    for name in ("fit.json", "subject.toml", "walk/kinematics.mot", ".kinertia.json"):
        (tmp_path / "results" / name).write_text("{}")
    with_results(app, "Änne", tmp_path / "results")
    answer = app.ask(f"/people/{quote('Änne')}/results.zip")
    assert answer.headers["content-disposition"] == "attachment; filename*=utf-8''%C3%84nne.zip"
    packed = zipfile.ZipFile(io.BytesIO(answer.body))
    assert sorted(packed.namelist()) == ["Änne/fit.json", "Änne/subject.toml", "Änne/walk/kinematics.mot"]
    assert app.ask("/people/nobody/results.zip").status == 404


def test_while_a_person_is_busy_nothing_is_changed(app, monkeypatch):
    person = app.library.add("Anna")
    monkeypatch.setattr(Jobs, "busy", lambda self, person: True)
    answer = app.post("/people/Anna/files?name=walk.trc", b"content", Accept="application/json")
    assert answer.status == 409
    assert "wait for the check or fit" in json.loads(answer.text)["problem"]
    for action in ("entries", "text", "remove", "recognise", "markers", "rename"):
        assert app.post(f"/people/Anna/{action}", "text=x").status == 409
    assert person.files() == []


def test_a_failure_of_ours_is_said_and_the_page_goes_on(app, monkeypatch):
    def broken(*_):
        raise RuntimeError("a bug")

    monkeypatch.setattr(routes, "standing", broken)
    app.library.add("Anna")
    answer = app.ask("/")
    assert answer.status == 500
    assert internal_error(RuntimeError("a bug"), "what its terminal shows") in answer.text
    assert app.ask("/people/Anna").status == 200


def test_a_disk_without_space_is_said(app, monkeypatch):
    async def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(routes, "receive", full)
    app.library.add("Anna")
    answer = app.post("/people/Anna/files?name=walk.trc", b"content", Accept="application/json")
    assert "No space left on device; check the path, its permissions" in json.loads(answer.text)["problem"]


def test_a_renamed_person_has_another_address(app):
    app.library.add("Person")
    answer = app.post("/people/Person/rename", f"name={quote('Änne <b>')}")
    assert (answer.status, answer.headers["location"]) == (303, f"{app.root}/people/{quote('Änne b')}")
    assert app.ask("/people/Person").status == 404
    assert [person.name for person in app.library.people()] == ["Änne b"]


def test_estimate_takes_what_is_in_the_form(app, c3d_lab, monkeypatch):
    added = []
    monkeypatch.setattr(Jobs, "add", lambda self, person, kind: added.append(kind))
    person = app.library.add("Anna")
    for path in c3d_lab.iterdir():
        shutil.copyfile(path, person.folder / path.name)
    before = person.subject.read_text()
    assert app.post("/people/Anna/fit", "mass_kg=72.6").status == 303
    assert person.subject.read_text() == before, "nothing was changed, so comments stay"
    assert app.post("/people/Anna/fit", "mass_kg=44").status == 303
    assert read_subject(person.subject).subject.mass_kg == 44.0
    refused = app.post("/people/Anna/fit", "mass_kg=heavy")
    assert refused.status == 422
    assert "is not a number; write it like 72.6" in refused.text
    assert added == ["fit", "fit"]


def test_people_to_try_it_with(tmp_path, sample_walk, monkeypatch):
    added = []
    monkeypatch.setattr(Jobs, "add", lambda self, person, kind: added.append((person.name, kind)))
    with running(tmp_path / "library", {"measured": write_measured_lab, "synthetic": write_synthetic_lab}) as app:
        home = app.ask("/").text
        assert "Try it with a measured walk" in home
        assert "Try it with a synthetic person" in home
        for kind in ("measured", "synthetic"):
            assert app.post(f"/example/{kind}").status == 303
        assert app.post("/example/other").status == 404
        people = {person.name: read_subject(person.subject) for person in app.library.people()}
    assert added == [("Example, measured", "check"), ("Example, synthetic", "check")]
    assert people["Example, measured"].trials[0].markers.name == "subject01_walk1.trc"
    assert people["Example, synthetic"].subject.name == "synthetic walker"


def test_where_there_is_no_network_the_synthetic_person_is_offered(tmp_path, monkeypatch):
    monkeypatch.setenv(samples.VARIABLE, str(tmp_path / "nothing"))
    monkeypatch.setattr(samples, "URL", "http://127.0.0.1:9/")
    with running(tmp_path / "library", {"measured": write_measured_lab, "synthetic": write_synthetic_lab}) as app:
        answer = app.post("/example/measured")
        assert answer.status == 422
        assert "the sample walk is not available" in answer.text
        assert "Try it with a synthetic person" in answer.text
        assert "Try it with a measured walk" not in answer.text
        assert app.library.people() == []


def test_text_that_cannot_be_read_is_shown_again(app):
    """Who mistypes a bracket does not type the rest again."""
    person = app.library.add("Anna")
    person.subject.write_text('[subject]\nsex = "male"\n')
    (person.folder / "walk.c3d").write_bytes(b"")
    typed = "[subject]\nmass_kg = 70  # long thought about\n[["
    answer = app.post("/people/Anna/text", f"text={quote(typed)}")
    assert answer.status == 422
    assert "F103 " in answer.text
    assert "mass_kg = 70  # long thought about" in answer.text
    assert "mass_kg" not in person.subject.read_text()


def test_entries_are_kept_before_something_else_takes_their_place(app, c3d_lab):
    person = app.library.add("Anna")
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(c3d_lab / name, person.folder / name)
    assert app.post("/people/Anna/keep", "sex=male").status == 200
    assert not person.subject.exists(), "nothing was recognised yet"
    app.post("/people/Anna/recognise")
    assert app.post("/people/Anna/keep", "sex=male&mass_kg=72%2C5").status == 200
    subject = read_subject(person.subject).subject
    assert (subject.sex, subject.mass_kg) == ("male", 72.5)
    assert not person.notes().get("saved"), "nor checked"
    answer = app.post("/people/Anna/keep", "mass_kg=heavy", accept="application/json")
    assert (answer.status, "Body mass (kg)" in answer.text) == (422, True)


def test_what_cannot_be_fitted_does_not_wait(app):
    person = app.library.add("Anna")
    assert app.post("/people/Anna/fit").status == 303
    assert app.post("/people/Anna/explode").status == 404
    assert person.notes() == {}


@pytest.mark.parametrize("form", ["copy", "entries", "text", "fit", "delete", "rename"])
def test_the_address_of_a_form_leads_to_the_person(app, form):
    person = app.library.add("Anna B")
    answer = app.ask(f"/people/Anna%20B/{form}")
    assert (answer.status, answer.headers["location"]) == (303, f"{app.root}/people/Anna%20B")
    assert app.ask(f"/people/nobody/{form}").status == 404
    assert app.ask("/people/Anna%20B/secret").status == 404
    assert app.library.people() == [person]


def test_two_conditions_are_offered_for_comparison_and_their_page_is_served(app, c3d_lab):
    from app_tab import with_everything

    person = with_everything(app.library, "Two", c3d_lab)
    shutil.copyfile(c3d_lab / "walk.c3d", person.folder / "walk 2.c3d")
    assert 'action="' + app.root + '/people/Two/comparison"' not in app.ask("/people/Two").text
    two = person.subject.read_text().replace('"walk.c3d"', '"walk.c3d"\ncondition = "shod"')
    person.subject.write_text(two + '\n[[trial]]\nmarkers = "walk 2.c3d"\ncondition = "barefoot"\n')
    shown = app.ask("/people/Two").text
    assert 'action="' + app.root + '/people/Two/comparison"' in shown
    assert "<option selected>barefoot</option>" in shown
    person.comparison.mkdir()
    outcome = {"summary": sha256(person.results / "fit.json"), "before": "barefoot", "after": "shod"}
    (person.comparison / "outcome.json").write_text(json.dumps(outcome))
    (person.comparison / "compare.html").write_text("<title>compared</title>")
    shown = app.ask("/people/Two").text
    assert "/people/Two/comparison/compare.html" in shown
    assert shown.count("<option selected>shod</option>") == 1
    served = app.ask("/people/Two/comparison/compare.html")
    assert (served.status, "compared" in served.text) == (200, True)
    assert "sandbox" in served.headers["content-security-policy"]
