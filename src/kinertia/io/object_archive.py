"""Saves frozen dataclasses in one file that stays readable without this program.

The file is a NumPy archive (`.npz`): a zip with one `.npy` member per array, named after its place
("fit.trials.0.motion.q"), and `structure.json` for everything else. Plain rather than netCDF or Parquet: a result is a
tree of a few hundred arrays of all shapes, not a table or a grid; NumPy's format is documented in one page (NEP 1),
MATLAB, R and Julia can read it, and it needs no further package. Nothing in it is ever executed, unlike pickled
objects.

Numbers are restored exactly. An object used in several places is written once.
"""

import io
import json
import math
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel
from scipy.interpolate import BSpline

from kinertia.errors import FileError

_STRUCTURE = "structure.json"
_FORMAT = 1
_SPLINE = "BSpline"
_QUICK = 1
"""Level of compression: the others take four times as long for a few percent."""
_SAMPLE_BYTES, _WORTH_IT = 4096, 0.9
"""Arrays of which a sample from the middle keeps a greater share of its size are left as they are: noise, as of most
measured numbers, takes longer to compress than all else takes to write."""


def write_archive(path: Path, content: object, kinds: Sequence[type], remarks: Mapping[str, str]) -> None:
    """Write an object made of these dataclasses, and of arrays, numbers, texts, sequences and mappings.

    Args:
        path: path of the file.
        content: the object.
        kinds: classes that may be in it; the file identifies them by name.
        remarks: written in clear at the beginning of `structure.json`.

    Raises:
        TypeError: something else is in it.
    """
    with zipfile.ZipFile(path, "w") as archive:
        tree = _Writer(archive, set(kinds)).plain(content, "")
        text = json.dumps({**remarks, "format": _FORMAT, "content": tree}, allow_nan=False)
        archive.writestr(*_member(_STRUCTURE, text.encode()), compresslevel=_QUICK)


def read_archive(path: Path, kinds: Sequence[type]) -> Any:
    """Read the object in a file of `write_archive`.

    Raises:
        FileError: there is no such file, it is damaged, or from a version with other content.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            structure = json.loads(archive.read(_STRUCTURE))
            if structure["format"] > _FORMAT:
                raise FileError(path, "was written by a later version of Kinertia; update it (pip install -U kinertia)")
            return _Reader(archive, {kind.__name__: kind for kind in kinds}).whole(structure["content"], "")
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror or error})") from error
    except (zipfile.BadZipFile, zlib.error, KeyError, ValueError, TypeError, EOFError) as error:
        problem = (
            f"is damaged or was written by another version of Kinertia ({type(error).__name__}: {error}); "
            "run the fit again"
        )
        raise FileError(path, problem) from error


def _member(name: str, content: bytes) -> tuple[zipfile.ZipInfo, bytes]:
    """Return an archive member that has the same bytes whenever it is written."""
    info, middle = zipfile.ZipInfo(name), len(content) // 2
    sample = content[middle : middle + _SAMPLE_BYTES]
    if len(zlib.compress(sample, _QUICK)) < _WORTH_IT * len(sample):
        info.compress_type = zipfile.ZIP_DEFLATED
    return info, content


class _Writer:
    """Converter of objects to JSON, with arrays as members of the archive."""

    def __init__(self, archive: zipfile.ZipFile, kinds: set[type]) -> None:
        self.archive, self.kinds = archive, kinds
        self.places: dict[int, str] = {}
        self.kept: list[object] = []  # so that no id is used twice

    def plain(self, thing: Any, place: str) -> Any:
        if isinstance(thing, np.generic):
            thing = thing.item()
        if thing is None or isinstance(thing, bool | int | str):
            return thing
        if isinstance(thing, float):
            return float(thing) if math.isfinite(thing) else {"float": repr(float(thing))}
        if isinstance(thing, Path):
            return {"path": str(thing)}
        if id(thing) in self.places:
            return {"same": self.places[id(thing)]}
        self.places[id(thing)] = place
        self.kept.append(thing)
        if isinstance(thing, np.ndarray):
            return self._array(thing, place)
        if isinstance(thing, bytes):
            return {"bytes": self._array(np.frombuffer(thing, np.uint8), place)["array"]}
        if isinstance(thing, Mapping):
            rows = [[self.plain(key, ""), self.plain(value, _below(place, key))] for key, value in thing.items()]
            return {"mapping": rows}
        if isinstance(thing, list | tuple) and not hasattr(thing, "_fields"):
            items = [self.plain(item, _below(place, k)) for k, item in enumerate(thing)]
            return items if isinstance(thing, list) else {"tuple": items}
        return {"kind": type(thing).__name__, "with": self._attributes(thing, place)}

    def _attributes(self, thing: Any, place: str) -> dict[str, Any]:
        if isinstance(thing, BSpline):
            names: Sequence[str] = ("t", "c", "k", "extrapolate")
        elif type(thing) not in self.kinds:
            raise TypeError(f"{place}: a {type(thing).__name__} cannot be written")
        else:
            names = _names(thing)
        return {name: self.plain(getattr(thing, name), _below(place, name)) for name in names}

    def _array(self, values: np.ndarray, place: str) -> dict[str, str]:
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, values, allow_pickle=False)
        self.archive.writestr(*_member(f"{place}.npy", buffer.getvalue()), compresslevel=_QUICK)
        return {"array": place}


def _names(thing: Any) -> Sequence[str]:
    if is_dataclass(thing):
        return [field.name for field in fields(thing)]
    return list(type(thing).model_fields) if isinstance(thing, BaseModel) else thing._fields


def _below(place: str, name: object) -> str:
    # names of members of an archive end at a zero
    word = repr(name) if "\0" in str(name) else str(name)
    return f"{place}.{word}" if place else word


class _Reader:
    """Converter of JSON and arrays back to objects."""

    def __init__(self, archive: zipfile.ZipFile, kinds: Mapping[str, type]) -> None:
        self.archive, self.kinds = archive, kinds
        self.made: dict[str, Any] = {}

    def whole(self, node: Any, place: str) -> Any:
        if not isinstance(node, dict | list):
            return node
        self.made[place] = made = self._made(node, place)
        return made

    def _made(self, node: Any, place: str) -> Any:
        if isinstance(node, list):
            return [self.whole(item, _below(place, k)) for k, item in enumerate(node)]
        if "kind" in node:
            attributes = {name: self.whole(value, _below(place, name)) for name, value in node["with"].items()}
            if node["kind"] == _SPLINE:
                return BSpline(attributes["t"], attributes["c"], attributes["k"], attributes["extrapolate"])
            return self.kinds[node["kind"]](**attributes)
        ((word, value),) = node.items()
        match word:
            case "same":
                return self.made[value]
            case "tuple":
                return tuple(self.whole(item, _below(place, k)) for k, item in enumerate(value))
            case "mapping":
                return {self.whole(key, ""): self.whole(item, _below(place, key)) for key, item in value}
            case "float":
                return float(value)
            case "path":
                return Path(value)
            case "bytes":
                return self._array(value).tobytes()
            case "array":
                return self._array(value)
        raise ValueError(f"unknown word '{word}'")

    def _array(self, place: str) -> np.ndarray:
        with self.archive.open(f"{place}.npy") as member:
            result: np.ndarray = np.lib.format.read_array(member, allow_pickle=False)
        return result
