"""Finds the day of a recording, in the subject file or in the recordings themselves.

The date of a file on the disk is that of its export or copy, and the dates of processing that Nexus writes into C3D
files are those of processing: neither is taken.
"""

import re
from datetime import date
from pathlib import Path

from kinertia.errors import FileError
from kinertia.io.c3d import structure as c3d_structure
from kinertia.io.subject.tables import SubjectFile

_HEADING_BYTES = 4096
_TIME_STAMP = re.compile(rb"^TIME_STAMP\t(\d{4})-(\d{2})-(\d{2})\b", re.MULTILINE)


def session_date(wanted: SubjectFile) -> date | None:
    """Return the date in the subject file, or of the first gait trial that states one; None where none does."""
    stated = wanted.instruments.date
    said = (recording_date(trial.markers) for trial in wanted.trials)
    return stated or next((day for day in said if day is not None), None)


def recording_date(path: Path) -> date | None:
    """Return the date from TRIAL:DATE of a C3D file (year, month, day: BTS), or TIME_STAMP of a Qualisys .tsv file."""
    try:
        if path.suffix.lower() == ".c3d":
            numbers = c3d_structure.trial_date(path)
        elif path.suffix.lower() == ".tsv":
            with path.open("rb") as stream:
                found = _TIME_STAMP.search(stream.read(_HEADING_BYTES))
            numbers = () if found is None else tuple(int(part) for part in found.groups())
        else:
            return None
        year, month, day = numbers
        return date(year, month, day)
    except (FileError, OSError, ValueError):
        return None
