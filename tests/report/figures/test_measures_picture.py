"""The picture of where to measure."""

from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from command_line import run
from kinertia.io.subject.body_files import measures_sheet
from kinertia.model.stadium_body import measures
from kinertia.report.figures.measures_picture import LEVELS, measures_picture

SVG = "{http://www.w3.org/2000/svg}"


def test_every_level_is_shown_once_with_its_words_apart_from_others():
    assert {measure.level for measure in measures()} <= set(LEVELS)
    root = ElementTree.fromstring(measures_picture())
    labels = ["".join(text.itertext()) for text in root.iter(f"{SVG}text")]
    assert all(labels.count(f"{name} {words}") == 1 for name, words in LEVELS.items())
    width, height = (float(root.get(name)) for name in ("width", "height"))
    points = [
        tuple(map(float, point.split(",")))
        for shape in root.iter()
        if shape.get("points")
        for point in shape.get("points").split()
    ]
    assert all(0.0 < x < width and 0.0 < y < height for x, y in points)
    for anchor in ("start", "end"):
        rows = sorted(float(text.get("y")) for text in root.iter(f"{SVG}text") if text.get("text-anchor") == anchor)
        assert all(below - above > 14.0 for above, below in pairwise(rows))


def test_the_picture_of_the_pages_is_this_one():
    picture = Path(__file__).parents[3] / "docs" / "figures" / "measures.svg"
    assert picture.read_text(encoding="utf-8") == measures_picture()


def test_the_command_writes_sheet_and_picture_and_overwrites_neither(tmp_path):
    outcome = run("init", tmp_path, "--measures")
    assert outcome.status == 0, outcome.err
    assert 'measures = "measures.csv" under [prior]' in outcome.out
    assert (tmp_path / "measures.csv").read_text(encoding="utf-8") == measures_sheet()
    assert (tmp_path / "measures.svg").read_text(encoding="utf-8") == measures_picture()
    assert not (tmp_path / "subject.toml").exists()
    again = run("init", tmp_path, "--measures")
    assert again.status != 0
    assert "already exists and was not changed" in again.err
    assert " F101 " in run("init", tmp_path / "elsewhere", "--measures").err
