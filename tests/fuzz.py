"""Small files of every format with damage in them, read by Kinertia: `python fuzz.py FOLDER SEED FIRST CASES COMMANDS`.

Ends with status 0 when each was accepted or refused with a KinertiaError, within ten seconds and a gigabyte. Otherwise
the last line of the standard error names the case, which can be repeated on its own.
"""

import contextlib
import faulthandler
import io
import os
import pickle
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
from dataclasses import replace
from pathlib import Path

import numpy as np

from c3d_writer import plate_parameters, write_c3d
from kinertia.cli.commands import main
from kinertia.errors import KinertiaError
from kinertia.io import marker_set_file
from kinertia.io.c3d import ezc3d_library
from kinertia.io.c3d import reader as c3d
from kinertia.io.ground_forces import read_forces
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.opensim.reader import read_osim
from kinertia.io.opensim.writer import export_osim
from kinertia.io.recording import read_recording
from kinertia.io.subject.reader import read_subject
from kinertia.io.text.sto import TimeTable, read_table, write_table
from kinertia.io.text.trc import write_trc
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import Markers, Recording
from lab_files import lab_walk, write_nexus, write_qtm

SECONDS, BYTES = 10, 1_000_000_000
TOKENS = [
    *(
        b"nan",
        b"inf",
        b"-1",
        b"0",
        b"1e300",
        b"-1e-300",
        b"1e12",
        b"99999999999999999999",
        b"\xc2\xb2",
        b"\xef\xbb\xbf",
    ),
    *(
        b"\0",
        b"\t",
        b"\n",
        b"\r\n",
        b" ",
        b",",
        b"=",
        b"<",
        b">",
        b"/>",
        b"<a>",
        b"&#0;",
        b"&x;",
        b'"',
        b"[[",
        b"]",
        b"\xff",
    ),
    *(
        b"~nobody/x",
        b"../x",
        b'encoding="foo"',
        b"\xed\xb3\xa4",
        b"true",
        b"mm",
        b"time",
        b"endheader",
        b"\x7f",
        b"\x80",
    ),
]
LOADS = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSimDocument Version="40000"><ExternalLoads name="loads"><objects>
<ExternalForce name="right"><applied_to_body>calcn_r</applied_to_body>
<force_expressed_in_body>ground</force_expressed_in_body><point_expressed_in_body>ground</point_expressed_in_body>
<force_identifier>ground_force_v</force_identifier><point_identifier>ground_force_p</point_identifier>
<torque_identifier>ground_torque_</torque_identifier></ExternalForce></objects><datafile>walk.mot</datafile>
</ExternalLoads></OpenSimDocument>
"""
SUBJECT = """[subject]
name = "A"
sex = "male"
mass_kg = 70.0
height_m = 1.7

[model]
static = "walk.trc"

[[trial]]
name = "one"
markers = "walk.trc"
forces = "walk.mot"
loads = "loads.xml"
window_s = [0.0, 0.1]

[settings]
cutoff_hz = 6.0
"""


def write_files(folder: Path) -> None:
    """One sound file of every format."""
    time_s, labels = np.arange(12) / 100, ("RASI", "LASI", "RKNE", "RHEE", "LHEE")
    places = np.random.default_rng(0).normal(0.0, 0.3, (1, 5, 3)) + np.array([0.0, 1.0, 0.0]) + time_s[:, None, None]
    write_trc(folder / "walk.trc", Markers(time_s, labels, places))
    names = [f"ground_{kind}{axis}" for kind in ("force_v", "force_p", "torque_") for axis in "xyz"]
    loads = np.tile([10.0, 700.0, 5.0, 0.1, 0.0, 0.2, 0.0, 3.0, 0.0], (12, 1))
    write_table(folder / "walk.mot", TimeTable(time_s, tuple(names), loads, False), "forces")
    (folder / "loads.xml").write_text(LOADS, encoding="utf-8")
    (folder / "subject.toml").write_text(SUBJECT, encoding="utf-8")
    preset = Path(marker_set_file.__file__).parent / "marker_sets" / "plug-in-gait.toml"
    (folder / "markers.toml").write_bytes(preset.read_bytes())
    person = walking_subject()
    export_osim(folder / "model.osim", person.skeleton, person.bsp)
    corners = np.array([[[0, 500, 0], [500, 500, 0], [500, 0, 0], [0, 0, 0]]], float)
    analogs = np.tile([-30.0, 20.0, -600.0, 100.0, 200.0, 5.0], (48, 1))
    screen = {"POINT": {"Y_SCREEN": ["+Z"]}, "FORCE_PLATFORM": plate_parameters(corners)}
    lab = few_frames(lab_walk())
    write_qtm(folder / "walk.tsv", lab)
    write_nexus(folder / "walk.csv", lab)
    write_c3d(folder / "walk.c3d", 1000 * places[..., [0, 2, 1]], list(labels), analogs, screen)


def few_frames(recording: Recording) -> Recording:
    """Twelve frames out of the middle, with their samples of the plates."""
    markers, plates = recording.markers, recording.plates
    ratio = (len(plates.time) - 1) // (len(markers.time) - 1)
    frames, samples = slice(60, 72), slice(60 * ratio, 71 * ratio + 1)
    loads = replace(plates, time=plates.time[samples], force=plates.force[samples], moment=plates.moment[samples])
    seen = Markers(markers.time[frames], markers.labels, markers.positions[frames])
    return replace(recording, markers=seen, plates=replace(loads, unloaded=None))


READERS = {
    "walk.trc": read_recording,
    "walk.mot": read_forces,
    "loads.xml": lambda path: read_forces(None, path),
    "table.mot": read_table,
    "subject.toml": read_subject,
    "markers.toml": read_marker_set,
    "model.osim": read_osim,
    "walk.c3d": read_recording,
    "walk.tsv": read_recording,
    "walk_f_1.tsv": lambda path: read_recording(path.with_name("walk.tsv")),
    "walk.csv": read_recording,
}


def damaged(content: bytes, rng: random.Random, text: bool) -> bytes:
    """The content after one to four accidents, most of them in its first part, where counts and names are."""
    altered = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        reach = max(1, min(len(altered), rng.choice((400, 2500, len(altered)))))
        at = rng.randrange(reach)
        match rng.randrange(8):
            case 0 | 1:
                altered[at : at + 1] = bytes([rng.randrange(256)])
            case 2:
                altered[at : at + 1] = bytes([rng.choice((0, 1, 127, 128, 255))])
            case 3:
                del altered[at : at + rng.choice((1, 4, 40, 400))]
            case 4:
                altered[at:at] = altered[at : at + rng.choice((1, 4, 40, 400))]
            case 5 if rng.random() < 0.3:
                del altered[at:]
            case 6 if text:
                token = rng.choice(TOKENS)
                altered[at:at] = token * (rng.choice((1, 1, 1, 300)))
            case 7 if text:
                cells = bytes(altered).split(b"\t")
                cells[rng.randrange(len(cells))] = rng.choice(TOKENS)
                altered = bytearray(b"\t".join(cells))
            case _:
                altered[at : at + 4] = rng.choice(
                    (b"\xff\xff\xff\xff", b"\x00\x00\x80\x7f", b"\x00\x00\xc0\x7f", b"\0\0\0\0")
                )
    return bytes(altered)


def forked(path: Path) -> ezc3d_library.C3dContent:
    """`read_in_subprocess` without the time that Python takes to start: the same function under the same limits."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "content"
        child = os.fork()
        if not child:
            faulthandler.cancel_dump_traceback_later()
            faulthandler.disable()
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            ezc3d_library._read_for_another(str(path), str(result))
            os._exit(0)
        ends = time.monotonic() + ezc3d_library._SECONDS
        while not os.waitpid(child, os.WNOHANG)[0]:
            if time.monotonic() > ends:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                raise ezc3d_library.C3dTrouble("too slow")
            time.sleep(0.001)
        if not result.is_file():
            raise ezc3d_library.C3dTrouble("broke down")
        content = pickle.loads(result.read_bytes())
    if isinstance(content, str):
        raise ezc3d_library.C3dTrouble(content)
    return content


def by_command(name: str) -> list[str]:
    """Arguments of a command that reads the file."""
    if name == "subject.toml":
        return ["check", name]
    if name == "model.osim":
        return ["check", name, "--mass", "70", "--height", "1.7", "--sex", "male", "-o", "out"]
    if name == "markers.toml":
        return ["check", "walk.trc", "--markers", name]
    if name in ("walk.mot", "loads.xml"):
        return ["check", "walk.trc", "walk.mot", "--loads", "loads.xml", "--mass", "70"]
    return ["check", name.replace("_f_1", ""), "-o", "out"]


def run_command(name: str) -> None:
    """Run the command; its status must be one of those that are not a failure of Kinertia."""
    text = io.StringIO()
    try:
        with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
            main(by_command(name))
    except SystemExit as end:
        if end.code not in (None, 0, 1, 2):
            raise RuntimeError(text.getvalue()[-1000:]) from None


def run(folder: Path, seed: int, first: int, cases: int, commands: int) -> int:
    """Cases from `first` on, the first ones of them by the command, too; how many were accepted."""
    os.chdir(folder)
    write_files(folder)
    sound = {name: (folder / name.replace("table", "walk")).read_bytes() for name in READERS}
    c3d.read_in_subprocess, ezc3d_library._SECONDS = (
        forked,
        0.2,
    )  # of ten milliseconds; nobody waits for a library that hangs
    used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * 4096
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
    accepted = 0
    for case in range(first, first + cases):
        rng = random.Random(f"{seed} {case}")
        name = list(READERS)[case % len(READERS)]
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        (folder / name).write_bytes(damaged(sound[name], rng, text=not name.endswith(".c3d")))
        Path("case").write_text(f"{case} {name}", encoding="utf-8")
        try:
            with contextlib.suppress(KinertiaError):
                READERS[name](folder / name)
                accepted += 1
            faulthandler.dump_traceback_later(SECONDS, exit=True)
            if case < first + commands and name != "table.mot":
                run_command(name)
        except BaseException:
            traceback.print_exc()
            print(f"seed {seed}, case {case}: {name}", file=sys.stderr)
            raise SystemExit(1) from None
        (folder / name).write_bytes(sound[name])
    faulthandler.cancel_dump_traceback_later()
    return accepted


if __name__ == "__main__":
    faulthandler.enable()
    print(run(Path(sys.argv[1]), *map(int, sys.argv[2:])))
