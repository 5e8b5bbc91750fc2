"""Belt speed over time: a CSV table, or a column of a MOT or STO file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.io.csv_file import read_csv
from kinertia.io.sto import read_table
from kinertia.trial.belt import Belt

COLUMNS = ("time_s", "speed_m_s")
_COLUMN = "belt_speed"
_FASTEST_M_S = 15.0


def read_belt(stated: float | tuple[float, float] | Path | None) -> Belt | None:
    """The speed of a treadmill's belt as a subject file states it: m/s, of two belts that under the right foot and that
    under the left, or a file with it over the markers' time.

    CSV has the columns `time_s` and `speed_m_s`; MOT and STO, which may be the force file, a column `belt_speed`.

    Raises:
        FileError: the file is missing or broken, lacks the column, time does not grow, or a speed is no
            treadmill's.
    """
    if stated is None:
        return None
    if isinstance(stated, float | tuple):
        return Belt(np.zeros(1), np.array([stated]))
    path = stated
    if path.suffix.lower() in (".mot", ".sto"):
        table = read_table(path)
        if _COLUMN not in table.labels:
            found = ", ".join(table.labels)
            raise FileError(path, f"has no column {_COLUMN} with the speed of the belt in m/s; found {found}")
        time, speed = table.time, table.columns([_COLUMN])[:, 0]
    else:
        rows = read_csv(path, COLUMNS, "a row per time: " + ",".join(COLUMNS))
        time, speed = np.array([[row.number(name) for name in COLUMNS] for row in rows]).T
    if not (np.isfinite(speed).all() and (np.diff(time) > 0).all()):
        raise FileError(path, "expected times that grow and a speed at each of them")
    if speed.min() < 0 or speed.max() > _FASTEST_M_S:
        raise FileError(
            path, f"speeds from {speed.min():g} to {speed.max():g}; expected 0 to {_FASTEST_M_S:g} m/s of a treadmill"
        )
    return Belt(time, speed)
