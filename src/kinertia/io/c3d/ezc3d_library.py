"""Loads ezc3d and works around its limits: missing wheels, and paths with umlauts.

ezc3d has no wheel for Linux on ARM: Kinertia works there without it, on every file but C3D. On Windows its C++ reads a
path in the machine's code page and does not find `C:/Users/Müller/walk.c3d`: such a file is read from a copy whose path
is ASCII. On some damaged files its C++ also crashes the process or never ends: those are read in a separate process.
"""

import contextlib
import math
import os
import pickle  # nosec B403 - of this process' own child, below
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.io.c3d.parameters import continued

try:
    import ezc3d
except ImportError:
    ezc3d = None

ONLY_ASCII_PATHS = sys.platform == "win32"
_COPY = "copy.c3d"
_INTEGER, _FLOAT = 2, 4
"""Types of a parameter as ezc3d has them."""
_PLATE_TYPES = {
    **dict.fromkeys(("USED", "TYPE", "ZERO", "CHANNEL"), _INTEGER),
    **dict.fromkeys(("CORNERS", "ORIGIN", "CAL_MATRIX"), _FLOAT),
}
_SECONDS, _SECONDS_PER_BYTE = 6.0, 1e-5
_WAITING = 20.0
_BYTES, _BYTES_PER_BYTE = 800_000_000, 20
"""Time limit of the reading process by size of the file, by how much longer it may take for that where the
machine has other things to do, and how much memory."""

C3dContent = dict[str, Any]
"""The parts of a file that are used, nested as in ezc3d: `header`, `parameters`, `data` (without analog values), and
`trouble`: why the force plates could not be read."""


class C3dTrouble(Exception):
    """Message of ezc3d about a file that it cannot read."""


def expect_ezc3d(path: Path) -> None:
    """Raise a FileError about a C3D file, with how to install ezc3d, unless it is installed."""
    if ezc3d is None:
        how = "conda install -c conda-forge ezc3d; pip has none for Linux on ARM"
        kinds = {"kind": Quantity("C3D files"), "others": Quantity("export TRC and MOT files")}
        raise FileError.found(path, "F107", **kinds, package=Quantity("ezc3d"), how=Quantity(how))


def read_content(path: Path) -> C3dContent:
    """Read the content of a C3D file.

    Raises:
        C3dTrouble: ezc3d cannot read it.
    """
    file = _readable(path)
    retyped = _retype(file["parameters"])
    shapes = _plate_shapes(file["parameters"])
    if retyped or shapes:
        file = _with_plate_shapes(file, shapes)
    plates, trouble = _plates(file)
    data, header = file["data"], file["header"]
    return {
        "header": {kind: dict(header[kind]) for kind in ("points", "analogs", "rotations") if kind in header},
        "parameters": {group: dict(entries) for group, entries in dict(file["parameters"]).items()},
        "data": {
            "points": data["points"],
            "analogs": data["analogs"][:, :0],
            "rotations": data.get("rotations", []),
            "platform": plates,
        },
        "trouble": trouble,
    }


def _retype(parameters: Any) -> bool:
    """Give numbers of force plates the types that ezc3d expects, and return whether any had another.

    Numbers and types of plates and channels are integers, which ezc3d itself writes as floats when Python adds them as
    lists; corners, origins and matrices are floats.
    """
    changed = False
    for name, kind in _PLATE_TYPES.items():
        values = np.array(parameter_values(parameters, "FORCE_PLATFORM", name))
        opposite_kind = np.floating if kind == _INTEGER else np.integer
        if len(values) and np.issubdtype(values.dtype, opposite_kind) and (values == np.round(values)).all():
            entry = parameters["FORCE_PLATFORM"][name]
            entry["type"] = kind
            entry["value"] = np.asarray(entry["value"]).astype(np.int32 if kind == _INTEGER else float)
            changed = True
    return changed


def _plate_shapes(parameters: Any) -> dict[str, tuple[int, ...]]:
    """Return the shapes that ezc3d expects of force plate lists, where the file stores the same numbers in others.

    ezc3d reads beyond the dimensions of lists that have too few, into arbitrary memory.
    """
    used = parameter_values(parameters, "FORCE_PLATFORM", "USED", [0])[0]
    plates = int(used) if isinstance(used, int | np.integer) else 0
    if plates < 1:
        return {}
    channels = len(parameter_values(parameters, "FORCE_PLATFORM", "CHANNEL")) // plates
    matrix = len(parameter_values(parameters, "FORCE_PLATFORM", "CAL_MATRIX")) // plates
    expected = {"CORNERS": (3, 4), "ORIGIN": (3,), "CHANNEL": (channels,), "CAL_MATRIX": (channels, channels)}
    if matrix != channels**2:
        del expected["CAL_MATRIX"]
    shapes = {}
    for name, shape in expected.items():
        values = parameter_values(parameters, "FORCE_PLATFORM", name)
        if len(values) == math.prod(shape) * plates > 0:
            stored = np.shape(parameters["FORCE_PLATFORM"][name]["value"])
            if stored != (*shape, plates):
                shapes[name] = (*shape, plates)
    return shapes


def _with_plate_shapes(file: Any, shapes: dict[str, tuple[int, ...]]) -> Any:
    """Read a copy of a file with force plate lists in these shapes, as `_readable` does."""
    for name, shape in shapes.items():
        entry = file["parameters"]["FORCE_PLATFORM"][name]
        entry["value"] = np.reshape(np.ravel(entry["value"], order="F"), shape, order="F")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / _COPY
        save_c3d(file, copy)
        return _readable(copy)


def _readable(path: Path) -> Any:
    """Read a file as ezc3d holds it.

    Raises:
        C3dTrouble: ezc3d cannot read it.
    """
    try:
        return _opened(path)
    except Exception as error:  # ezc3d lets OSError, RuntimeError, IndexError and more through
        raise C3dTrouble(str(error)) from None


def _plates(file: Any) -> tuple[list[dict[str, np.ndarray]], str]:
    """Return the loads on force plates, or none and the reason why ezc3d cannot compute them."""
    try:
        return [_plate(platform) for platform in ezc3d.ezc3d.ForcePlatforms(file.c3d_swig).forcePlatforms()], ""
    except Exception as error:
        return [], str(error)


def _plate(plate: Any) -> dict[str, np.ndarray]:
    """Return corners (3, 4), origin (3,) and loads (3, k) of a plate: moments or, of type 1, what these are made from.

    ezc3d itself would turn all of them into arrays, sample by sample, which takes longer than to read the file.
    """
    loads = {"force": plate.forces()}
    if plate.type() == 1:
        loads |= {"center_of_pressure": plate.CoP(), "Tz": plate.Tz()}
    else:
        loads["moment"] = plate.moments()
    content = {name: _columns(vectors) for name, vectors in loads.items()}
    return {"corners": _columns(plate.corners()), "origin": plate.origin().to_array()[:, 0], **content}


def _columns(vectors: Sequence[Any]) -> np.ndarray:
    """Return vectors of ezc3d as columns (3, n)."""
    return np.concatenate([np.empty((3, 0)), *(vector.to_array() for vector in vectors)], axis=1)


def parameter_values(parameters: Any, group: str, name: str, default: Sequence[Any] = ()) -> Sequence[Any]:
    """Return the values of one parameter of a `C3dContent` in file order, for any shape.

    USED and TYPE of p plates are p values, and CHANNEL 6 p: some writers make them p x 1, or one row.
    """
    with contextlib.suppress(KeyError, TypeError):
        values = np.ravel(parameters[group][name]["value"], order="F")
        if len(values):
            return list(values)
    return default


def text_list(parameters: Any, group: str, name: str) -> list[str]:
    """Return a list of strings, with the entries that continue under other names."""

    def entries(parameter: str) -> list[str]:
        return [str(entry).strip() for entry in parameter_values(parameters, group, parameter)]

    return continued(entries, name)


def read_in_subprocess(path: Path) -> C3dContent:
    """Run `read_content` in a separate process, with limits of time and memory.

    Raises:
        C3dTrouble: ezc3d cannot read it, or crashes.
    """
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "content"
        command = [sys.executable, "-P", "-m", __name__, str(path.absolute()), str(result)]
        places = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        seconds = _SECONDS + _SECONDS_PER_BYTE * path.stat().st_size
        try:
            done = subprocess.run(command, capture_output=True, timeout=_WAITING * seconds, check=False, env=places)
        except subprocess.TimeoutExpired:
            raise C3dTrouble(f"reading it took more than {_WAITING * seconds:.0f} s") from None
        if not result.is_file():
            raise C3dTrouble(f"the library that reads it crashed, exit status {done.returncode}")
        content = pickle.loads(result.read_bytes())  # nosec B301 - written by the child, in a private folder
    if isinstance(content, str):
        raise C3dTrouble(content)
    return dict(content)


def _read_for_another(path: str, result: str) -> None:
    """Run `read_content` for the process that waits for `result`, which is written completely or not at all."""
    if sys.platform != "win32":  # on Windows the time limit alone has to suffice
        import resource

        size = Path(path).stat().st_size
        seconds = int(_SECONDS + _SECONDS_PER_BYTE * size) + 1 + int(time.process_time())
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        limit = _BYTES + _BYTES_PER_BYTE * size + _virtual_size()
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        content: C3dContent | str = read_content(Path(path))
    except (C3dTrouble, MemoryError) as trouble:
        content = str(trouble) or "it needs too much memory"
    half = Path(result + ".half")
    half.write_bytes(pickle.dumps(content))
    half.replace(result)


def _virtual_size() -> int:
    """Return the address space (bytes) of this process with its libraries, on Linux; elsewhere a negligible number."""
    with contextlib.suppress(OSError, ValueError):
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * 4096
    return 0


def _opened(path: Path) -> Any:
    """Open a C3D file as ezc3d holds it; ezc3d's own errors pass through."""
    if _found_by_ezc3d(path):
        return ezc3d.c3d(str(path))
    with _elsewhere(path) as original:
        shutil.copyfile(original, _COPY)
        return ezc3d.c3d(_COPY)


def new_c3d(path: Path) -> Any:
    """Create an empty C3D file to fill, which is to be written to `path`.

    Raises:
        FileError: ezc3d is not installed.
    """
    expect_ezc3d(path)
    return ezc3d.c3d()


def save_c3d(file: Any, path: Path) -> None:
    """Write what ezc3d holds to a file."""
    if _found_by_ezc3d(path):
        file.write(str(path))
        return
    with _elsewhere(path) as target:
        file.write(_COPY)
        shutil.copyfile(_COPY, target)


def _found_by_ezc3d(path: Path) -> bool:
    return not ONLY_ASCII_PATHS or str(path).isascii()


@contextlib.contextmanager
def _elsewhere(path: Path) -> Iterator[Path]:
    """Yield a path in a temporary folder, which may have umlauts in its name: files in it are addressed from within."""
    whole = path.absolute()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        yield whole


if __name__ == "__main__":
    _read_for_another(*sys.argv[1:])
