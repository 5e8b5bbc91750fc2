"""Reads the speed of a belt over time: a CSV table, or a column of a MOT or STO file."""

from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.io.text.csv_file import has_columns, read_csv
from kinertia.io.text.sto import read_table
from kinertia.trial.belt import Belt

_ONE_CSV, _TWO_CSV = ("speed_m_s",), ("right_m_s", "left_m_s")
_ONE, _TWO = ("belt_speed",), ("belt_speed_right", "belt_speed_left")
_FASTEST_M_S = 15.0


def read_belt(stated: float | tuple[float, float] | Path | None) -> Belt | None:
    """Read the speed of a treadmill's belt as a subject file states it: m/s, for two belts the speeds under the right
    and the left foot, or a file with the speed over the markers' time.

    CSV has the columns `time_s` and `speed_m_s`, of two belts `time_s`, `right_m_s` and `left_m_s`; MOT and STO, which
    may be the force file, a column `belt_speed`, of two belts `belt_speed_right` and `belt_speed_left`.

    Raises:
        FileError: the file is missing or broken, lacks the columns, time does not increase, or a speed is impossible
            for a treadmill.
    """
    if stated is None:
        return None
    if isinstance(stated, float | tuple):
        return Belt(np.zeros(1), np.array([stated]))
    path = stated
    time, speed = _from_table(path) if path.suffix.lower() in (".mot", ".sto") else _from_csv(path)
    if not (np.isfinite(speed).all() and (np.diff(time) > 0).all()):
        raise FileError.found(path, "F181", problem=Quantity("times must increase, with a speed for each"))
    if speed.min() < 0 or speed.max() > _FASTEST_M_S:
        range_ = Quantity((float(speed.min()), float(speed.max())), "m/s", limit=_FASTEST_M_S)
        problem = f"speeds from {speed.min():g} to {speed.max():g} m/s; a treadmill's are 0 to {_FASTEST_M_S:g} m/s"
        raise FileError.found(path, "F181", speed_m_s=range_, problem=Quantity(problem))
    return Belt(time, speed)


def _from_table(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and one speed or the speeds under right and left foot."""
    table = read_table(path)
    names = next((names for names in (_ONE, _TWO) if set(names) <= set(table.labels)), None)
    if names is None:
        lacking = f"no column {_ONE[0]} in m/s, nor {' and '.join(_TWO)} for two belts"
        raise FileError.found(path, "F181", problem=Quantity(f"{lacking}; found {', '.join(table.labels)}"))
    return table.time, _one_or_two(table.columns(list(names)))


def _from_csv(path: Path) -> tuple[np.ndarray, np.ndarray]:
    names = ("time_s", *(_TWO_CSV if has_columns(path, _TWO_CSV) else _ONE_CSV))
    expected = f"a row per time: {','.join(('time_s', *_ONE_CSV))}, of two belts {','.join(('time_s', *_TWO_CSV))}"
    rows = np.array([[row.number(name) for name in names] for row in read_csv(path, names, expected)])
    return rows[:, 0], _one_or_two(rows[:, 1:])


def _one_or_two(speeds: np.ndarray) -> np.ndarray:
    return speeds[:, 0] if speeds.shape[1] == 1 else speeds
