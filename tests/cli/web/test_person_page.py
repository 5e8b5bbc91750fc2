"""What a person's page says to those who know no subject file."""

import re

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")
pytest.importorskip("uvicorn", reason="needs the extra app (pip install -e '.[test]')")

from app_server import running

STATIC, WALK = "static = 'static.c3d'\n", "[[trial]]\nmarkers = 'walk.c3d'\n"
WHOLE = f"[subject]\nsex = 'male'\nmass_kg = 70\nheight_m = 1.8\n[model]\n{STATIC}{WALK}"


@pytest.mark.parametrize(
    ("written", "instead", "plain", "as_the_command_line"),
    [
        ("sex = 'male'\n", "", "Sex is missing: fill it in", "[subject] lacks 'sex'"),
        (WALK, "", "No file is used as a walk", "[[trial]]: there is no such heading"),
        (WALK, "[[trial]]\n", "No file is used as a walk", "[[trial]] lacks 'markers'"),
        ("mass_kg = 70\n", "mass_kg = 7000\n", "", "S102"),
    ],
)
def test_what_is_missing_is_said_in_the_words_of_the_form(tmp_path, written, instead, plain, as_the_command_line):
    with running(tmp_path / "library") as app:
        person = app.library.add("Anna")
        for name in ("static.c3d", "walk.c3d"):
            (person.folder / name).write_bytes(b"")
        person.subject.write_text(WHOLE.replace(written, instead))
        first = app.ask("/people/Anna").text.replace("&#39;", "'")
        person.note(saved=True)
        page = app.ask("/people/Anna").text.replace("&#39;", "'")
    (before,) = re.findall(r'<p class="message warning">(.*?)</p>', first, re.DOTALL)
    assert plain in before
    assert not plain or "line" not in before, "no line number before anything was saved"
    (message,) = re.findall(r'<p class="message error"[^>]*>(.*?)</p>', page, re.DOTALL)
    assert plain in message
    assert re.search(r"subject\.toml(, line \d+)?: ", message)
    assert as_the_command_line in message
    assert str(tmp_path) not in message
