"""Edits the parameter section of a C3D file record by record; unchanged records keep their bytes.

A record is an entry or the head of a group: length of the name (negative where locked), number of the group (negative
for its head), name, distance to the next record, then type, shape and values of an entry, and a description
(https://www.c3d.org/HTML/Documents/theparametersection.htm).
"""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

_BLOCK = 512
_MOST_BLOCKS = 255
_MOST = 255
"""Entries of a list, and characters of an entry: both are counted in one byte."""
_DESCRIPTIONS = {
    "KINERTIA": "Results of Kinertia, and what they are from",
    "ANALYSIS": "Measures of the gait cycle",
    "EVENT": "Events of the trial",
    "MANUFACTURER": "Who made and changed this file",
}
"""Of groups that are made here."""
_NUMBERS = {1: "i1", 2: "i2", 4: "f4"}
_TEXT = ("utf-8", "surrogateescape")
"""Bytes that are no UTF-8 come back as they were."""

Value = Sequence[str] | np.ndarray
"""Texts, or integers (16 bits) or floats (32 bits) of any shape."""


def continued(entries: Callable[[str], Sequence[str]], name: str) -> list[str]:
    """Return a list of texts that continues in NAME2, NAME3 after 255; `entries` returns the texts of one name."""
    found: list[str] = []
    for suffix in ["", *map(str, range(2, 100))]:
        more = entries(name + suffix)
        if not more:
            break
        found += more
    return found


class TooManyParameters(Exception):
    """Parameters that need more blocks than one byte can count."""


@dataclass(frozen=True)
class Record:
    """One record: the number of its group, its name, and the bytes before and after the offset to the next record."""

    group: int
    name: str
    head: bytes
    body: bytes


class ParameterSection:
    """Parameter section of a C3D file, all records in order; `get`, `put` and `content` read, change and write them."""

    def __init__(self, section: bytes, order: str) -> None:
        """Parse a section that passed the checks of `structure`, with this byte order ("<" or ">")."""
        self.order, self.start = order, section[:4]
        self.records: list[Record] = []
        at = 4
        while at + 2 <= len(section) and section[at]:
            length, group = struct.unpack_from("bb", section, at)
            link = at + 2 + abs(length)
            (offset,) = struct.unpack_from(f"{order}h", section, link)
            end = self._end(section, link + 2, group > 0)
            name = section[at + 2 : link].decode("latin-1").upper()
            self.records.append(Record(group, name, section[at:link], section[link + 2 : end]))
            if not offset:
                break
            at = link + offset

    @staticmethod
    def _end(section: bytes, at: int, entry: bool) -> int:
        if entry:
            kind, dimensions = struct.unpack_from("bB", section, at)
            shape = section[at + 2 : at + 2 + dimensions]
            at += 2 + dimensions + abs(kind) * math.prod(shape)
        return at + 1 + section[at]

    def get(self, group: str, name: str) -> Value | None:
        """Return the texts of an entry without trailing blanks, or its numbers in a row; None where it is absent."""
        k = self._find(group, name)
        if k is None:
            return None
        body = self.records[k].body
        kind, dimensions = struct.unpack_from("bB", body)
        shape = tuple(body[2 : 2 + dimensions])
        values = body[2 + dimensions : 2 + dimensions + abs(kind) * math.prod(shape)]
        if kind != -1:
            return np.frombuffer(values, f"{self.order}{_NUMBERS[kind]}")
        width = shape[0] if shape else 1
        text = values.decode(*_TEXT) if len(shape) < 2 else ""
        if len(shape) < 2:
            return [text.rstrip(" \0")]
        rows = [values[k : k + width] for k in range(0, len(values), width)] if width else [b""] * math.prod(shape[1:])
        return [row.decode(*_TEXT).rstrip(" \0") for row in rows]

    def put(self, group: str, name: str, value: Value, shape: tuple[int, ...] | None = None) -> None:
        """Set an entry to this value; the entry and its group are created if missing.

        Args:
            group, name: which entry.
            value: its value; texts are stored as wide as the longest, or as before where that is wider; whole numbers
                in two bytes, in one if they are of type int8, or were and fit.
            shape: shape as in the file, fastest dimension first; one list if None.
        """
        k = self._find(group, name)
        old = None if k is None else self.records[k]
        width = old.body[2] if old is not None and old.body[:1] == b"\xff" and old.body[1] > 1 else 1
        described = old.body[self._described(old.body) :] if old is not None else b"\0"
        bytewise = old is not None and old.body[:1] == b"\x01"
        body = self._plain(value, shape, width, bytewise) + described
        if old is not None and k is not None:
            self.records[k] = Record(old.group, old.name, old.head, body)
            return
        number = self._group(group)
        encoded = name.encode("ascii")
        self.records.append(Record(number, name, struct.pack("bb", len(encoded), number) + encoded, body))

    def drop(self, group: str) -> None:
        """Remove a group and its entries."""
        number = next((-record.group for record in self.records if record.group < 0 and record.name == group), None)
        self.records = [record for record in self.records if abs(record.group) != number]

    def content(self) -> bytes:
        """Return the bytes of the section, in whole blocks.

        Raises:
            TooManyParameters: it would need more than 255.
        """
        parts = []
        for record in self.records:
            parts += [record.head, struct.pack(f"{self.order}h", 2 + len(record.body)), record.body]
        body = b"".join(parts) + b"\0\0"
        blocks = -(-(4 + len(body)) // _BLOCK)
        if blocks > _MOST_BLOCKS:
            raise TooManyParameters
        head = self.start[:2] + bytes([blocks]) + self.start[3:4]
        return (head + body).ljust(blocks * _BLOCK, b"\0")

    def _described(self, body: bytes) -> int:
        kind, dimensions = struct.unpack_from("bB", body)
        return int(2 + dimensions + abs(kind) * math.prod(body[2 : 2 + dimensions]))

    def _plain(self, value: Value, shape: tuple[int, ...] | None, width: int, bytewise: bool) -> bytes:
        if isinstance(value, np.ndarray):
            kind = 2 if np.issubdtype(value.dtype, np.integer) else 4
            if value.dtype == np.int8 or (kind == 2 and bytewise and np.array_equal(value, value.astype(np.int8))):
                kind = 1
            sizes = shape or (value.size,)
            numbers = np.ravel(value).astype(f"{self.order}{_NUMBERS[kind]}").tobytes()
            return struct.pack("bB", kind, len(sizes)) + bytes(sizes) + numbers
        texts = [text.encode(*_TEXT)[:_MOST] for text in value]
        width = max([width, *map(len, texts)])
        sizes = (width, *(shape or (len(texts),)))
        return struct.pack("bB", -1, len(sizes)) + bytes(sizes) + b"".join(text.ljust(width) for text in texts)

    def _find(self, group: str, name: str) -> int | None:
        number = next((-record.group for record in self.records if record.group < 0 and record.name == group), None)
        return next(
            (k for k, record in enumerate(self.records) if record.group == number and record.name == name), None
        )

    def _group(self, name: str) -> int:
        """Return the number of a group, which is created if missing."""
        for record in self.records:
            if record.group < 0 and record.name == name:
                return -record.group
        number = 1 + max((abs(record.group) for record in self.records), default=0)
        encoded, description = name.encode("ascii"), _DESCRIPTIONS.get(name, "").encode("ascii")
        head = struct.pack("bb", len(encoded), -number) + encoded
        self.records.append(Record(-number, name, head, bytes([len(description)]) + description))
        return number
