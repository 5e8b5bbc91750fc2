"""The threats of SECURITY.md that no other test has: each is named, and the tests that it names are there."""

import re
import time
from pathlib import Path

import pytest

from kinertia.errors import KinertiaError
from kinertia.io.ground_forces import read_forces
from kinertia.io.opensim.reader import read_osim

ROOT = Path(__file__).parents[2]


def test_every_test_that_the_page_names_is_there():
    named = set(re.findall(r"`(tests/[\w/]+\.py)`", (ROOT / "SECURITY.md").read_text(encoding="utf-8")))
    assert len(named) >= 5
    assert [name for name in sorted(named) if not (ROOT / name).is_file()] == []


@pytest.mark.parametrize("name", ["loads.xml", "model.osim"])
def test_entities_that_expand_without_end_are_refused(tmp_path, name):
    levels = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 10))
    bomb = f'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY e0 "lol">{levels}]><OpenSimDocument>&e9;</OpenSimDocument>'
    assert _refused(tmp_path / name, bomb)


@pytest.mark.parametrize("name", ["loads.xml", "model.osim"])
def test_entities_read_no_other_file(tmp_path, name):
    (tmp_path / "secret.txt").write_text("a secret")
    entity = f'<!DOCTYPE a [<!ENTITY e SYSTEM "{(tmp_path / "secret.txt").as_uri()}">]>'
    document = f'<?xml version="1.0"?>{entity}<OpenSimDocument><Model name="m">&e;</Model></OpenSimDocument>'
    assert "secret" not in _refused(tmp_path / name, document).replace("secret.txt", "")


def _refused(path, text):
    path.write_text(text, encoding="utf-8")
    started = time.process_time()
    with pytest.raises(KinertiaError) as caught:
        read_osim(path) if path.suffix == ".osim" else read_forces(None, path)
    assert time.process_time() - started < 10
    return str(caught.value)
