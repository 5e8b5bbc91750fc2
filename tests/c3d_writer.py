"""A minimal C3D writer, so that tests can make files that no laboratory would."""

import struct
from pathlib import Path

import numpy as np

Parameters = dict[str, dict[str, object]]


def plate_parameters(corners: np.ndarray, kind: int = 2, origin_z: float = -20.0) -> dict[str, object]:
    """FORCE_PLATFORM parameters of p plates with six channels each; `corners` is (p, 4, 3) in file units."""
    count = len(corners)
    return {
        "USED": np.array([count], np.int16),
        "TYPE": np.full(count, kind, np.int16),
        "ZERO": np.array([1, 0], np.int16),
        "CORNERS": np.moveaxis(corners, 0, 2).swapaxes(0, 1).astype(float),
        "ORIGIN": np.tile([[0.0], [0.0], [origin_z]], (1, count)),
        "CHANNEL": np.arange(1, 6 * count + 1, dtype=np.int16).reshape(count, 6).T,
        "CAL_MATRIX": np.stack([np.eye(6)] * count, axis=2),
    }


def write_c3d(
    path: Path,
    points: np.ndarray,
    labels: list[str],
    analogs: np.ndarray | None = None,
    parameters: Parameters | None = None,
    rate_hz: float = 100.0,
    unit: str = "mm",
    moment_unit: str | None = None,
    first_frame: int = 1,
    integers: bool = False,
) -> Path:
    """Write points (n, m, 3) with NaN as missing and analogs (n * s, c), both in file units; as 16-bit `integers`
    points in tenths of it, and analogs as they are."""
    n, m = points.shape[:2]
    analogs = np.zeros((n, 0)) if analogs is None else analogs
    per_frame, channels = len(analogs) // n, analogs.shape[1]
    units = [unit_ for _ in range(channels // 6) for unit_ in ["N"] * 3 + [moment_unit or f"N{unit}"] * 3]
    groups: Parameters = {
        "POINT": {
            "USED": np.array([m], np.int16),
            "FRAMES": np.array([n], np.int16),
            "SCALE": np.array([0.1 if integers else -1.0]),
            "RATE": np.array([rate_hz]),
            "UNITS": [unit],
            "LABELS": labels[:255],
            **({"LABELS2": labels[255:]} if labels[255:] else {}),
            "DATA_START": np.array([0], np.int16),
        },
        "ANALOG": {
            "USED": np.array([channels], np.int16),
            "RATE": np.array([rate_hz * per_frame]),
            "UNITS": units,
            "LABELS": [f"channel {k}" for k in range(1, channels + 1)],
            "SCALE": np.ones(channels),
            "OFFSET": np.zeros(channels, np.int16),
            "GEN_SCALE": np.array([1.0]),
        },
    }
    for group, entries in (parameters or {}).items():
        groups.setdefault(group, {}).update(entries)
    blocks = len(_section(groups)) // 512
    groups["POINT"]["DATA_START"] = np.array([2 + blocks], np.int16)
    missing = np.isnan(points).any(axis=2, keepdims=True)
    places = 10.0 * points if integers else points
    rows = np.concatenate((np.where(missing, 0.0, places), np.where(missing, -1.0, 0.0)), axis=2)
    data = np.concatenate((rows.reshape(n, 4 * m), analogs.reshape(n, per_frame * channels)), axis=1)
    header = struct.pack("<BBHHHHHfHHf", 2, 0x50, m, per_frame * channels, first_frame, first_frame + n - 1, 0,
                         0.1 if integers else -1.0, 2 + blocks, per_frame, rate_hz)  # fmt: skip
    content = data.round().astype(np.int64).astype("<u2") if integers else data.astype("<f4")
    path.write_bytes(header.ljust(512, b"\0") + _section(groups) + content.tobytes())
    return path


def _section(groups: Parameters) -> bytes:
    entries = b""
    for number, (group, parameters) in enumerate(groups.items(), start=1):
        entries += struct.pack("<bb", len(group), -number) + group.encode() + struct.pack("<hB", 3, 0)
        for name, value in parameters.items():
            kind, shape, content = _encoded(value)
            body = struct.pack(f"<bB{len(shape)}B", kind, len(shape), *shape) + content + b"\0"
            entries += struct.pack("<bb", len(name), number) + name.encode()
            entries += struct.pack("<h", 2 + len(body)) + body
    entries += b"\0\0"
    blocks = -(-(len(entries) + 4) // 512)
    return (struct.pack("<BBBB", 1, 0x50, blocks, 84) + entries).ljust(512 * blocks, b"\0")


def _encoded(value: object) -> tuple[int, tuple[int, ...], bytes]:
    if isinstance(value, list):
        width = max([len(text) for text in value], default=0)
        return -1, (width, len(value)), "".join(text.ljust(width) for text in value).encode()
    array = np.asarray(value)
    kind, form = (2, "<i2") if array.dtype == np.int16 else (4, "<f4")
    return kind, array.shape, array.astype(form).tobytes(order="F")
