"""The example of a package that extends Kinertia, as if installed: its marker set, reader and rule are found."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

PLUGIN = Path(__file__).parents[2] / "examples" / "plugin"
LABELS = ["EX_R_ASIS", "EX_L_ASIS", "EX_V_Sacral", "EX_R_Knee", "EX_L_Knee"]


def describe(folder: Path, points: dict[str, dict[str, str]]) -> None:
    """Write what an installer writes about a package and its entry points."""
    info = folder / "kinertia_example-0.1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: kinertia-example\nVersion: 0.1.0\n")
    groups = (f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in names.items()) for group, names in points.items())
    (info / "entry_points.txt").write_text("".join(groups))


@pytest.fixture
def installed(tmp_path):
    project = tomllib.loads((PLUGIN / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    describe(tmp_path / "site", project["entry-points"])
    return [tmp_path / "site", PLUGIN / "src"]


def ran(code: str, paths: list[Path], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths))}
    command = [sys.executable, "-P", "-c", code]
    return subprocess.run(command, env=environment, cwd=folder, capture_output=True, encoding="utf-8", check=False)


def answer(code: str, paths: list[Path], folder: Path):
    done = ran(f"import json, kinertia\n{code}", paths, folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def write_walk(path: Path, seconds: float) -> None:
    rows = [",".join(["time", *LABELS])]
    for k in range(round(seconds * 100) + 1):
        rows.append(",".join(map(str, [k / 100, *(100.0 * j + k for j in range(3 * len(LABELS)))])))
    path.write_text("\n".join(rows), encoding="utf-8")


def test_its_marker_set_is_a_preset(installed, tmp_path):
    code = "print(json.dumps([*kinertia.read_marker_set('example-lab').labels]))"
    assert set(LABELS) <= set(answer(code, installed, tmp_path))


def test_its_reader_reads_and_what_it_cannot_read_is_the_files_fault(installed, tmp_path):
    write_walk(tmp_path / "walk.gaitlab", 1.0)
    (tmp_path / "broken.gaitlab").write_text("time,EX_R_ASIS\n0,one,2,3\n")
    code = "walk = kinertia.read_recording('walk.gaitlab')\nprint(json.dumps(walk.markers.positions[10, 1].tolist()))"
    assert answer(code, installed, tmp_path) == pytest.approx([0.31, 0.41, 0.51])
    refused = ran("import kinertia; kinertia.read_recording('broken.gaitlab')", installed, tmp_path)
    assert "kinertia.errors.FileError" in refused.stderr
    assert "broken.gaitlab" in refused.stderr


@pytest.mark.parametrize(("seconds", "found"), [(0.4, 1), (0.6, 0)])
def test_its_rule_is_asked_beside_the_others(installed, tmp_path, seconds, found):
    write_walk(tmp_path / "walk.gaitlab", seconds)
    code = (
        "check = kinertia.check_recording(kinertia.read_recording('walk.gaitlab'))\n"
        "print(json.dumps([one.message for one in check.findings if one.code == 'X101']))"
    )
    messages = answer(code, installed, tmp_path)
    assert len(messages) == found
    assert all(message == "The recording lasts 0.40 s; the protocol asks for half a second." for message in messages)


def test_without_it_nothing_of_it_is_known(tmp_path):
    write_walk(tmp_path / "walk.gaitlab", 1.0)
    code = (
        "import kinertia.findings.rule as rule, kinertia.io.marker_set_file as sets, kinertia.io.recording as files\n"
        "known = [rule.matching('X'), 'example-lab' in sets.preset_names(), '.gaitlab' in files.MARKER_FILES]\n"
        "print(json.dumps(known))"
    )
    assert answer(code, [], tmp_path) == [[], False, False]


def test_what_kinertia_has_itself_stays_its_own(tmp_path):
    points = {"kinertia.rules": {"P": "nowhere:x"}, "kinertia.marker_sets": {"plug-in-gait": "nowhere:x"}}
    describe(tmp_path / "site", points | {"kinertia.readers": {"trc": "nowhere:x"}})
    code = "print(json.dumps([kinertia.rule('P213').name, kinertia.read_marker_set('plug-in-gait').name]))"
    names = answer("import kinertia.workflow.screening\n" + code, [tmp_path / "site"], tmp_path)
    assert names == ["plate-zero-offset", "Plug-in Gait"]


def test_a_package_that_cannot_be_loaded_is_named(tmp_path):
    describe(tmp_path / "site", {"kinertia.marker_sets": {"example-lab": "nowhere:x"}})
    done = ran("import kinertia; kinertia.read_marker_set('example-lab')", [tmp_path / "site"], tmp_path)
    assert "ExtensionError" in done.stderr
    assert "kinertia-example" in done.stderr


@pytest.mark.parametrize("words", [["explain", "X101"], ["check"]])
def test_the_command_line_names_it_and_no_internal_error(tmp_path, synthetic_lab, words):
    command = words if words[1:] else [*words, str(synthetic_lab / "walk.c3d")]
    describe(tmp_path / "site", {"kinertia.rules": {"X": "nowhere:x"}})
    code = f"import sys; sys.argv = ['kinertia', *{command}]; from kinertia.cli.start import main; main()"
    done = ran(code, [tmp_path / "site"], tmp_path)
    assert done.returncode == 2
    assert "kinertia-example" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Internal error" not in done.stderr


@pytest.mark.parametrize("installed", [False, True])
def test_nothing_that_lies_beside_recordings_is_taken_for_a_package(tmp_path, installed):
    describe(tmp_path, {"kinertia.rules": {"X": "trap:x"}})
    (tmp_path / "trap.py").write_text("open('trapped', 'w').close()\n")
    environment = os.environ | ({"PYTHONPATH": str(tmp_path)} if installed else {})
    command = [sys.executable, "-m", "kinertia", "explain", "X101"]
    subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False)
    assert (tmp_path / "trapped").exists() == installed
