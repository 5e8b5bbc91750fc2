"""Checks the structure of a C3D file before ezc3d reads it, which trusts every count and offset.

One wrong byte in them can crash ezc3d, hang it, or fill the memory. Unreadable files raise an error here; files that
only contradict themselves are read in a process that may crash (`ezc3d_library`).
"""

import math
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, mismatch, wrong_kind
from kinertia.findings.quantity import Quantity

_BLOCK = 512
_MIPS = 86
_BYTE_ORDERS = {84: ("<", 15), 85: ("<", 13), _MIPS: (">", 12)}
"""By processor (Intel, DEC, MIPS): byte order of integers, and the header byte with the sign of POINT:SCALE,
which is negative where numbers are stored as floats."""
_KINDS = {-1: "c", 1: "b", 2: "h", 4: "f"}
_CHANNELS = {1: (6,), 2: (6,), 3: (8,), 4: (6,)}
"""Numbers of channels by type of plate."""
_MOST_EVENTS = 18


@dataclass(frozen=True)
class _Header:
    """Content of the first block of a C3D file."""

    points: int
    analogs: int
    first: int
    last: int
    scale: float
    data_block: int
    samples: int
    rate_hz: float
    events: int

    @property
    def frames(self) -> int:
        """Number of frames; 0 where 16 bits cannot hold it."""
        return self.last - self.first + 1 if self.first <= self.last < 0xFFFF else 0


@dataclass(frozen=True)
class _Parameter:
    """One entry of the parameter section: its shape, its bytes, and the byte of the section at which they begin."""

    kind: str
    shape: tuple[int, ...]
    content: bytes
    order: str
    at: int = 0

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """Values of the entry; none for text."""
        if self.kind == "c":
            return ()
        return struct.unpack(f"{self.order}{math.prod(self.shape)}{self.kind}", self.content)

    @property
    def size(self) -> int:
        """Number of values; for text, number of lines."""
        return math.prod(self.shape[1:] if self.kind == "c" else self.shape)


_Parameters = dict[tuple[str, str], _Parameter]


def doubts_about(path: Path, numbers_of_frames: bool = True) -> str:
    """Describe contradictions within a C3D file that may crash ezc3d; empty where there are none.

    Args:
        path: the file.
        numbers_of_frames: whether to check the numbers in TRIAL, which programs that crop a recording leave unchanged.

    Raises:
        FileError: it is empty, not a C3D file, shorter than announced, or its parameters cannot be parsed.
    """
    block, start, section = _sections(path)
    size = path.stat().st_size
    if len(block) < _BLOCK or len(section) < 4:
        needed = _BLOCK if len(block) < _BLOCK else start + _BLOCK
        raise _too_short(path, size, needed)
    order, sign_byte = _BYTE_ORDERS.get(section[3], ("<", 15))
    header = _header(block, order)
    number = 4 if block[sign_byte] & 0x80 else 2
    data = _BLOCK * (header.data_block - 1) + number * (4 * header.points + header.analogs) * header.frames
    needed = max(start + _BLOCK * section[2], data)
    if size < needed:
        raise _too_short(path, size, needed)
    if section[3] not in _BYTE_ORDERS:
        return f"its processor is {section[3]}"
    if section[3] == _MIPS:
        given, expected = "A big-endian (MIPS) C3D file", "a little-endian (Intel) one; save it in that format"
        raise wrong_kind(path, given, "be read", expected)
    if section[3] == 85:
        return "its numbers are DEC's"
    parameters, doubt = _parameters(path, section, order)
    doubt = doubt or _header_doubt(header, start + _BLOCK * section[2]) or _doubt(header, parameters)
    return doubt or (_trial_doubt(header, parameters) if numbers_of_frames else "")


def _too_short(path: Path, size: int, needed: int) -> FileError:
    counts = {"bytes": Quantity(size, "1"), "announced": Quantity(needed, "1")}
    return FileError.found(path, "F104", **counts, found=Quantity(f"it has {size} of at least {needed} bytes"))


def trial_date(path: Path) -> tuple[int, ...]:
    """Return TRIAL:DATE of a C3D file, which some systems write: year, month, day; empty where it is missing.

    Raises:
        FileError: as `doubts_about`.
    """
    _, _, section = _sections(path)
    if len(section) < 4 or section[3] not in _BYTE_ORDERS:
        return ()
    parameters, _ = _parameters(path, section, _BYTE_ORDERS[section[3]][0])
    entry = parameters.get(("TRIAL", "DATE"))
    return () if entry is None else tuple(int(number) for number in entry.numbers)


def with_plain_samples(path: Path) -> bytes | None:
    """Return an integer C3D file with ANALOG:OFFSET subtracted from its samples, if ezc3d would not do it; else None.

    ezc3d assumes signed samples and positive offsets. Some files wrongly state that their samples are unsigned:
    negative samples would then be read as the largest.

    Raises:
        FileError: a sample is farther from its offset than 16 bits hold; or as `doubts_about`.
    """
    block, start, section = _sections(path)
    if len(block) < _BLOCK or len(section) < 4 or section[3] not in _BYTE_ORDERS:
        return None
    order, sign_byte = _BYTE_ORDERS[section[3]]
    parameters, _ = _parameters(path, section, order)
    said, offset = parameters.get(("ANALOG", "FORMAT")), parameters.get(("ANALOG", "OFFSET"))
    header = _header(block, order)
    channels = header.analogs // max(header.samples, 1)
    if block[sign_byte] & 0x80 or not channels or offset is None or offset.kind != "h" or offset.size < channels:
        return None
    unsigned = said is not None and said.content.strip(b" \0").upper() == b"UNSIGNED"
    if not unsigned and min(offset.numbers) >= 0:
        return None
    content = bytearray(path.read_bytes())
    first, per_frame = _BLOCK * (header.data_block - 1), 4 * header.points + header.analogs
    frames = header.frames or (len(content) - first) // (2 * per_frame)
    if first < 0 or not frames:
        return None
    words = np.frombuffer(content, f"{order}i2", per_frame * frames, first).reshape(frames, per_frame)
    samples = words[:, 4 * header.points :].reshape(-1, channels).astype(int)
    offsets = np.frombuffer(content, f"{order}i2", offset.size, start + offset.at)
    taken_off = offsets[:channels].astype(int)
    if unsigned and np.ptp(samples % 65536, axis=0).sum() <= np.ptp(samples, axis=0).sum():
        samples, taken_off = samples % 65536, taken_off % 65536
    if samples.max() < 32768 and taken_off.max() < 32768 and taken_off.min() >= 0:
        return None
    plain = samples - taken_off
    if np.abs(plain).max() > 32767:
        steps = int(np.abs(plain).max())
        what = f"samples are up to {steps} steps from ANALOG:OFFSET, beyond 16-bit integers (see ANALOG:FORMAT)"
        raise FileError.found(path, "F106", steps=Quantity(steps, "1", limit=32767), what=Quantity(what))
    words[:, 4 * header.points :] = plain.reshape(frames, -1)
    offsets[:] = 0
    return bytes(content)


def _sections(path: Path) -> tuple[bytes, int, bytes]:
    """Return the first block, the offset of the parameters, and the parameters."""
    with path.open("rb") as stream:
        block = stream.read(_BLOCK)
        if not block:
            raise FileError.found(path, "F104", bytes=Quantity(0, "1"), found=Quantity("it is empty"))
        if len(block) < 2 or block[1] != 0x50:
            raise mismatch(path, "a C3D file", f"{block[1:2].hex() or 'no'} as second byte", "50 (hexadecimal)")
        start = _BLOCK * (block[0] - 1)
        if start < _BLOCK:
            what = f"its parameters begin in block {block[0]}, not in 2 or later"
            raise FileError.found(path, "F106", what=Quantity(what))
        stream.seek(start)
        section = stream.read(4)
        if len(section) == 4:
            section += stream.read(_BLOCK * section[2] - 4) if section[2] else b""
    return block, start, section


def header_frames(path: Path) -> int:
    """Return the number of frames in the header of a C3D file; 0 where it is not stated."""
    with path.open("rb") as stream:
        block = stream.read(_BLOCK)
        stream.seek(_BLOCK * (block[0] - 1) + 3 if block[:1] > b"\0" else 0)
        processor = stream.read(1)
    if len(block) < _BLOCK or not processor:
        return 0
    order, _ = _BYTE_ORDERS.get(processor[0], ("<", 15))
    return _header(block, order).frames


def _header(block: bytes, order: str) -> _Header:
    points, analogs, first, last = struct.unpack_from(f"{order}4H", block, 2)
    (scale,) = struct.unpack_from(f"{order}f", block, 12)
    data_block, samples = struct.unpack_from(f"{order}2H", block, 16)
    (rate_hz,) = struct.unpack_from(f"{order}f", block, 20)
    (events,) = struct.unpack_from(f"{order}H", block, 300)
    return _Header(points, analogs, first, last, scale, data_block, samples, rate_hz, events)


def _parameters(path: Path, section: bytes, order: str) -> tuple[_Parameters, str]:
    """Read all parameters by group and name, and describe what is irregular about their storage."""
    groups: dict[int, str] = {}
    entries: dict[tuple[int, str], _Parameter] = {}
    at, odd = 4, ""

    def broken(what: str) -> FileError:
        place = {"byte": Quantity(at, "1")}
        return FileError.found(path, "F106", **place, what=Quantity(f"{what}, at byte {at} of its parameters"))

    while at + 2 <= len(section) and section[at]:
        length, group = struct.unpack_from("bb", section, at)
        length = abs(length)
        link = at + 2 + length
        if not group or link + 3 + (group > 0) > len(section):
            raise broken("an entry without a group or end")
        name = section[at + 2 : link].decode("latin-1").upper()
        called = f"'{name}'" if name.isprintable() else "an entry"
        (offset,) = struct.unpack_from(f"{order}h", section, link)
        body = link + 2
        if group > 0:
            kind, dimensions = struct.unpack_from("bB", section, body)
            shape = tuple(section[body + 2 : body + 2 + dimensions])
            body += 2 + dimensions
            bytes_needed = abs(kind) * math.prod(shape)
            if kind not in _KINDS or len(shape) < dimensions or body + bytes_needed >= len(section):
                raise broken(f"{called} is longer than the parameters are, or of an unknown type")
            entries[group, name] = _Parameter(_KINDS[kind], shape, section[body : body + bytes_needed], order, body)
            body += bytes_needed
        elif -group in groups or name in groups.values():
            odd = odd or f"it has the group {called} twice"
            groups[-group] = name
        else:
            groups[-group] = name
        end = body + 1 + section[body]
        if end > len(section):
            raise broken(f"the description of {called} has no end")
        if not offset:
            break
        if link + offset != end:
            if not end <= link + offset <= len(section):
                raise broken(f"{called} says that the next entry begins inside it or outside the parameters")
            odd = odd or f"there is a gap after {called}"
        at = link + offset
    if any(group not in groups for group, _ in entries):
        odd = odd or "an entry belongs to no group"
    return {(groups.get(group, ""), name): value for (group, name), value in entries.items()}, odd


def _header_doubt(header: _Header, end: int) -> str:
    """Describe impossible values in the header."""
    if not (math.isfinite(header.rate_hz) and 0.01 < header.rate_hz < 1e6):
        return f"its frame rate is {header.rate_hz:g} Hz"
    if not math.isfinite(header.scale) or header.scale == 0:
        return f"its scale is {header.scale:g}"
    if _BLOCK * (header.data_block - 1) < end:
        return "its data begin inside its parameters"
    if header.events > _MOST_EVENTS:
        return f"its header has {header.events} events"
    return "" if header.frames else "its header has no number of frames"


def _doubt(header: _Header, parameters: _Parameters) -> str:
    """Describe parameters that contradict the header or other parameters."""

    def value(group: str, name: str, default: float) -> float:
        entry = parameters.get((group, name))
        return entry.numbers[0] if entry is not None and entry.numbers else default

    def unsigned(group: str, name: str, default: float) -> float:
        number = value(group, name, default)
        return number + 65536 if number < 0 else number

    channels, samples = unsigned("ANALOG", "USED", 0), max(header.samples, 1)
    pairs = {
        "POINT:USED": (unsigned("POINT", "USED", -1), header.points),
        "ANALOG:USED": (channels * samples, header.analogs),
        "POINT:FRAMES": (unsigned("POINT", "FRAMES", header.frames), header.frames),
        "POINT:DATA_START": (unsigned("POINT", "DATA_START", header.data_block), header.data_block),
    }
    for name, (stated, expected) in pairs.items():
        if stated != expected:
            return f"{name} contradicts its header"
    rate_hz = value("POINT", "RATE", header.rate_hz)
    if not abs(rate_hz - header.rate_hz) <= 0.01 * header.rate_hz:
        return "POINT:RATE contradicts its header"
    if channels and not abs(value("ANALOG", "RATE", rate_hz * samples) - rate_hz * samples) <= 0.01 * rate_hz * samples:
        return "ANALOG:RATE contradicts its header"
    if value("POINT", "SCALE", header.scale) * header.scale < 0:
        return "POINT:SCALE contradicts its header"
    return _list_doubt(parameters, int(channels)) or _plate_doubt(parameters, channels)


def _trial_doubt(header: _Header, parameters: _Parameters) -> str:
    """Compare TRIAL:ACTUAL_START_FIELD and ..._END_FIELD, two words of 16 bits each, with the header."""
    for name, expected in (("ACTUAL_START_FIELD", header.first), ("ACTUAL_END_FIELD", header.last)):
        entry = parameters.get(("TRIAL", name))
        if entry is not None:
            words = [int(number) & 0xFFFF for number in entry.numbers] if entry.kind in "bh" else []
            if len(words) != 2 or words[0] + 65536 * words[1] != expected:
                return f"TRIAL:{name} contradicts its header"
    return ""


def _list_doubt(parameters: _Parameters, channels: int) -> str:
    """Find lists per channel that are shorter than the number of channels, or not numbers."""
    rotations = parameters.get(("ROTATION", "USED"))
    if rotations is not None and rotations.numbers != (0,):  # ezc3d writes that there are none
        return "it has rotations"
    for name in ("SCALE", "OFFSET"):
        entry = parameters.get(("ANALOG", name))
        if channels and (entry is None or len(entry.numbers) < channels):
            return f"ANALOG:{name} has too few entries"
    for (group, name), entry in parameters.items():
        expected = "c" if name in ("LABELS", "UNITS", "DESCRIPTIONS") and group in ("POINT", "ANALOG") else ""
        if expected and entry.kind != expected:
            return f"{group}:{name} is no text"
        if name in ("USED", "RATE", "SCALE", "OFFSET", "FRAMES") and entry.kind == "c":
            return f"{group}:{name} is text"
        if not all(map(math.isfinite, entry.numbers)) and (group, name) != ("ANALOG", "OFFSET"):
            return f"{group}:{name} is not a number"
    return ""


def _plate_doubt(parameters: _Parameters, channels: float) -> str:
    """Find force plates whose lists do not fit their number and type."""

    def entry(name: str) -> _Parameter:
        return parameters.get(("FORCE_PLATFORM", name)) or _Parameter("h", (0,), b"", "<")

    if not any(group == "FORCE_PLATFORM" for group, _ in parameters):
        return ""
    count = int(entry("USED").numbers[0]) if entry("USED").numbers else -1
    if count == 0:
        return ""
    types = entry("TYPE").numbers
    if count < 0 or len(types) < count:
        return "FORCE_PLATFORM:TYPE has too few entries"
    rows = len(entry("CHANNEL").numbers) / max(entry("CHANNEL").shape[-1] if entry("CHANNEL").shape else 1, 1)
    for plate, kind in enumerate(types[:count]):
        if kind not in _CHANNELS or rows < max(_CHANNELS[int(kind)]):
            return f"force plate {plate + 1} is of type {kind:g}, with {rows:g} channels"
    for name, shape in (("CORNERS", (3, 4)), ("ORIGIN", (3,)), ("CHANNEL", ())):
        stored = entry(name).shape
        if (
            not entry(name).numbers
            or stored[: len(shape)] != shape
            or (stored[-1] < count and len(stored) > len(shape))
        ):
            return f"FORCE_PLATFORM:{name} does not fit {count} plates"
        if len(entry(name).numbers) < math.prod(shape) * count:
            return f"FORCE_PLATFORM:{name} does not fit {count} plates"
    if 4 in types[:count] and len(entry("CAL_MATRIX").numbers) < 36 * count:
        return f"FORCE_PLATFORM:CAL_MATRIX does not fit {count} plates"
    if not all(1 <= number <= channels for number in entry("CHANNEL").numbers[: int(rows) * count]):
        return "FORCE_PLATFORM:CHANNEL names channels that do not exist"
    return ""
