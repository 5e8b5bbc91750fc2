"""Spoiling the files of a laboratory, and what `kinertia fit` must say of it."""

import re

from command_line import run
from kinertia.io.trc import read_trc, write_trc

COMMAND = {
    "forces": "walk.mot",
    "loads": "walk.xml",
    "static": "static.trc",
    "mass": "72.6",
    "height": "1.803",
    "sex": "male",
}


def refused(lab, walk="walk.trc", **changes):
    """Run `kinertia fit` where it must fail; the message. The folder beside the results must stay as it was."""
    options = {**(COMMAND if walk.endswith(".trc") else {"static": "static.c3d", "sex": "male"}), **changes}
    arguments = [walk if walk.startswith("/") else lab / walk]
    for name, value in options.items():
        if value is not None:
            arguments += [f"--{name}", lab / value if name in ("forces", "loads", "static") else value]
    return complaint(lab, *arguments)


def complaint(lab, *arguments):
    outcome = run("fit", *arguments, "-o", lab.parent / "results" / "out")
    assert outcome.status == 2, outcome
    assert outcome.out == ""
    *before, last = outcome.err.splitlines()
    assert set(before) <= {"reading", "calibration", "inverse kinematics"}
    assert last.startswith("error: ")
    assert [path.name for path in lab.parent.iterdir()] == ["lab"]
    return last


def expect(message, *parts):
    for part in parts:
        assert re.search(part, message), f"{part!r} is not in {message!r}"


def spoil(path, change):
    """Rewrite a text file line by line: `change` gets the list of lines and alters it."""
    lines = path.read_text().splitlines()
    change(lines)
    path.write_text("\n".join(lines) + "\n")


def replace_in(path, old, new):
    text = path.read_text()
    assert text.count(old) >= 1, old
    path.write_text(text.replace(old, new, 1))


def edit_cell(line, column, value):
    def change(lines):
        cells = lines[line - 1].split("\t")
        cells[column] = value
        lines[line - 1] = "\t".join(cells)

    return change


def changed_markers(path, change):
    markers = read_trc(path)
    positions = markers.positions.copy()
    change(positions, markers.labels.index)
    write_trc(path, type(markers)(markers.time, markers.labels, positions))
