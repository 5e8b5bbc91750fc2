"""Defines errors that a user can act on: what was found, where, what was expected, what to do.

Every error that Kinertia raises on purpose derives from `KinertiaError` and carries the data of its message as
attributes. The command line prints the message as one line and exits with status 2.
"""

from __future__ import annotations

import os
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Self

from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where

_DRIVE = re.compile(r"[A-Za-z]:[\\/]")


def problem_of(found: Finding) -> str:
    """Return code, message and remedy of a finding, as used in errors."""
    return f"{found.code} {found.message} {found.remedy}"


def how_to_install(extra: str) -> str:
    """Return how to install what an extra of the package needs: as in README, since no package index has Kinertia.

    >>> how_to_install("app")
    'pip install ".[app]" in the folder of Kinertia'
    """
    return f'pip install ".[{extra}]" in the folder of Kinertia'


def internal_error(problem: BaseException | str, sent: Path | str) -> str:
    """Describe an error of Kinertia itself, and what its developers need to be sent.

    >>> internal_error(ZeroDivisionError("division by zero"), "failure.log")
    'Internal error of Kinertia (ZeroDivisionError: division by zero). Please send failure.log to its developers.'
    """
    text = traceback.format_exception_only(problem)[-1] if isinstance(problem, BaseException) else problem
    return f"Internal error of Kinertia ({' '.join(text.split())}). Please send {sent} to its developers."


class KinertiaError(Exception):
    """Base of all errors raised on purpose; `str(error)` is one complete sentence for the user.

    Attributes:
        finding: finding of the catalogue, with its evidence; None for errors without a code.

    Examples:
        >>> try:
        ...     kinertia.read_recording("walk.trc")
        ... except kinertia.KinertiaError as error:
        ...     print(type(error).__name__)
        FileError
    """

    finding: Finding | None = None

    def with_finding(self, found: Finding) -> Self:
        """Attach a finding to the error, and return the error."""
        self.finding = found
        return self

    def __reduce__(self) -> tuple[object, ...]:
        """Support pickling between processes: errors cannot be rebuilt from their message alone."""
        return _restored, (type(self), self.args, self.__dict__)


def _restored(kind: type[KinertiaError], args: tuple[object, ...], data: dict[str, object]) -> KinertiaError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(data)
    return error


class FileError(KinertiaError):
    """A file is missing, unreadable, or not what its name suggests.

    Attributes:
        path: the file.
        line: one-based line number of the problem, or None.
        problem: what was found, what was expected and what to do.
        also: other errors of the same file.

    Examples:
        >>> error = kinertia.FileError("subject.toml", "unknown key 'mas_kg'; did you mean 'mass_kg'?", line=3)
        >>> str(error), error.line
        ("subject.toml, line 3: unknown key 'mas_kg'; did you mean 'mass_kg'?", 3)
    """

    def __init__(self, path: str | Path, problem: str, line: int | None = None) -> None:
        self.path = Path(path)
        self.line = line
        self.problem = problem
        self.also: tuple[FileError, ...] = ()
        where = f"{self.path}" if line is None else f"{self.path}, line {line}"
        super().__init__(f"{where}: {problem}")

    @classmethod
    def found(
        cls,
        path: str | Path,
        code: str,
        line: int | None = None,
        at: Where | None = None,
        /,
        **evidence: Quantity,
    ) -> Self:
        """Create the error of a rule of the catalogue, with its evidence.

        Args:
            path: the file.
            code: code of the rule.
            line: one-based line number.
            at: plate, markers or time that it concerns.
            evidence: measured quantities, the headline first.

        Examples:
            >>> from kinertia import FileError, Quantity
            >>> FileError.found("walk.mot", "F142", force=Quantity("ground_force_v")).finding.code
            'F142'
        """
        return cls.of(path, with_evidence(code, at or Where(), evidence), line)

    @classmethod
    def of(cls, path: str | Path, found: Finding, line: int | None = None) -> Self:
        """Create the error of a finding, in this file and line."""
        where = replace(found.where, file=Path(path).name or str(path), line=line)
        placed = replace(found, where=where, severity=Severity.ERROR)
        return cls(path, problem_of(placed), line).with_finding(placed)


def expect_file(path: Path, expected: str = "a file") -> None:
    """Raise a FileError that states the folder and the nearest names in it, unless `path` is a file."""
    if os.path.isfile(path):
        return
    if os.path.isdir(path):
        raise wrong_kind(path, "A folder", "be read here", expected)
    raise FileError.found(path, "F101", **missing_file(path, str(path), expected))


def expect_path(path: Path) -> None:
    """Raise a FileError unless a file or folder has this path."""
    if not os.path.exists(path):
        raise FileError.found(path, "F101", **missing_file(path, str(path), "a recording, a subject file or a folder"))


def wrong_kind(path: Path, given: str, what: str, expected: str) -> FileError:
    """Return the error that `given` "cannot {what}; expected {expected}"."""
    return FileError.found(path, "F102", given=Quantity(given), what=Quantity(what), expected=Quantity(expected))


def mismatch(path: Path, kind: str, found: str, expected: str, line: int | None = None) -> FileError:
    """Return the error that the content "is not {kind}: found {found}, expected {expected}"."""
    return FileError.found(path, "F103", line, found=Quantity(found), kind=Quantity(kind), expected=Quantity(expected))


def malformed(path: Path, line: int | None, found: str, expected: str, **known: Quantity) -> FileError:
    """Return the error of a cell or row: "found {found}; expected {expected}"; `cell` and `column` for one cell."""
    return FileError.found(path, "F105", line, **known, found=Quantity(found), expected=Quantity(expected))


def missing_file(path: Path, written: str, expected: str = "", is_folder: bool = False) -> dict[str, Quantity]:
    """Return evidence of F101: the file, the folder that was searched, and similar names in it.

    Args:
        path: path that leads to no file.
        written: the path as the user wrote it.
        expected: what it should be, in words.
        is_folder: whether it should be a folder: then names of files are no help.
    """
    folder = path.parent.absolute()
    exists = os.path.isdir(folder)
    beside = [entry for entry in folder.iterdir() if entry.is_dir() or not is_folder] if exists else []
    names = {entry.name.lower(): entry.name for entry in beside if entry.name[0] != "."}
    nearest = [names[near] for near in get_close_matches(path.name.lower(), sorted(names), n=3, cutoff=0.4)]
    hint = "nothing there has a similar name" if exists else "that folder does not exist"
    if nearest:
        hint = f"the nearest name{'s' * (len(nearest) > 1)} there: {', '.join(nearest)}"
    hint = _foreign_path(written) or hint
    if expected not in ("", "a file"):
        hint += f" (expected {expected})"
    evidence = {"nearest": Quantity(", ".join(nearest))} if nearest else {}
    words = {"file": _printable(path.name), "folder": _printable(str(folder)), "hint": hint}
    return evidence | {name: Quantity(text) for name, text in words.items()}


def _printable(text: str) -> str:
    return text if text.isprintable() else ascii(text)


def _foreign_path(written: str) -> str:
    """Explain why a path leads nowhere, where it is written in Windows' notation; empty if that is not the reason."""
    if any(ord(letter) < 32 for letter in written):
        return "the path has a tab or line end, which TOML makes of \\t and \\n in double quotes: write / instead of \\"
    if _DRIVE.match(written) and not Path(written).is_absolute():
        return f"drive {written[:2]} of Windows is not on this computer: give the path from here"
    return ""


def wrong_entry(entry: str, expected: str, known: Mapping[str, Quantity] | None = None) -> Finding:
    """Return F191 about an entry of the subject file: what was expected, and what else is known of it."""
    return with_evidence("F191", Where(), {**(known or {}), "entry": Quantity(entry), "expected": Quantity(expected)})


class MarkerSetError(KinertiaError):
    """A marker set does not fit the labels of a trial.

    Attributes:
        missing: what is missing (labels or landmarks).
        nearest: for each missing item, the labels of the trial that look most like it.

    Examples:
        >>> try:
        ...     kinertia.choose_marker_set(["A", "B", "C"])
        ... except kinertia.MarkerSetError as error:
        ...     print(len(error.missing) > 10)
        True
    """

    def __init__(self, problem: str, missing: Sequence[str] = (), nearest: dict[str, list[str]] | None = None):
        self.missing = tuple(missing)
        self.nearest = dict(nearest or {})
        super().__init__(problem)


class TrialError(KinertiaError):
    """A trial cannot be used: no overlap of forces and markers, no measured frame, a marker lost, NaN in forces.

    Attributes:
        trial: the trial's name.
        problem: what was found, what was expected and what to do.

    Examples:
        >>> str(kinertia.TrialError("walk 1", "no force plate in it; give its forces"))
        "trial 'walk 1': no force plate in it; give its forces"
    """

    def __init__(self, trial: str, problem: str) -> None:
        self.trial = trial
        self.problem = problem
        super().__init__(f"trial '{trial}': {problem}")

    @classmethod
    def found(cls, trial: str, code: str, at: Where | None = None, /, **evidence: Quantity) -> Self:
        """Create the error of a rule of the catalogue, with its evidence.

        Args:
            trial: the trial's name.
            code: code of the rule.
            at: plate, markers or time that it concerns.
            evidence: measured quantities, the headline first.
        """
        return cls.of(trial, with_evidence(code, at or Where(), evidence))

    @classmethod
    def of(cls, trial: str, found: Finding) -> Self:
        """Create the error of a finding, in this trial."""
        placed = found.in_trial(trial).at(Severity.ERROR)
        return cls(trial, problem_of(placed)).with_finding(placed)


class SubjectError(KinertiaError):
    """A subject's mass, height or sex is missing or implausible.

    Attributes:
        field: the field's name (`mass_kg`, `height_m`, `sex`).
        value: what was given.

    Examples:
        >>> str(kinertia.SubjectError("mass_kg", 72600, "give the body mass in kilograms"))
        'mass_kg = 72600: give the body mass in kilograms'
    """

    def __init__(self, field: str, value: object, problem: str) -> None:
        self.field = field
        self.value = value
        super().__init__(f"{field}: {problem}" if value is None else f"{field} = {value}: {problem}")


class PriorError(KinertiaError):
    """A prior of body segment parameters is impossible: an SD that is not positive, or an invalid covariance (F191).

    Attributes:
        parameter: "segment.parameter" that is wrong, or None.

    Examples:
        >>> kinertia.PriorError("the covariance is not symmetric").finding.code
        'F191'
    """

    def __init__(self, problem: str, parameter: str | None = None, found: Finding | None = None) -> None:
        entry = "prior of body segment parameters"
        self.parameter = parameter
        self.finding = found or wrong_entry(entry, problem)
        super().__init__(f"{entry}: {problem}" if found else problem_of(self.finding))

    @classmethod
    def of(cls, found: Finding) -> Self:
        """Create the error of a finding that has a code of its own."""
        return cls(problem_of(found), found=found)


class SettingsError(KinertiaError):
    """An entry of the subject file or an option of the command line is missing or invalid.

    Examples:
        >>> isinstance(kinertia.SettingsError("cutoff_hz must be positive"), kinertia.KinertiaError)
        True
    """

    @classmethod
    def of_entry(cls, entry: str, problem: str) -> Self:
        """Create the error of an entry that another one contradicts or lacks: F191.

        >>> kinertia.SettingsError.of_entry("[model]", "expected a marker set").finding.code
        'F191'
        """
        return cls.of(wrong_entry(entry, problem))

    @classmethod
    def of(cls, found: Finding) -> Self:
        """Create the error of a finding."""
        return cls(problem_of(found)).with_finding(found)


class SessionError(KinertiaError):
    """Trials of different people cannot be combined for plates and synchronisation: S502.

    Examples:
        >>> kinertia.SessionError("plates are told by their names").finding.code
        'S502'
    """

    def __init__(self, problem: str) -> None:
        super().__init__(f"S502 {problem}")
        self.finding = finding("S502", problem=Quantity(problem))


class OsimError(FileError):
    """An OpenSim model file cannot be used: broken, of an unknown format, or a model that Kinertia cannot represent.

    Attributes:
        element: name of the joint, body, marker or constraint that it concerns; empty for the file as a whole.
        kind: the element's type, for example "EllipsoidJoint".

    Examples:
        >>> kinertia.OsimError("scaled.osim", "a joint that closes a loop", 120, element="knee_r").element
        'knee_r'
    """

    def __init__(self, path: str | Path, problem: str, line: int | None = None, element: str = "", kind: str = ""):
        self.element = element
        self.kind = kind
        super().__init__(path, problem, line)

    @classmethod
    def about(cls, path: str | Path, found: Finding, line: int | None = None) -> Self:
        """Create the error of a finding about an element, with the name and kind in its evidence."""
        error = cls.of(path, found, line)
        texts = [found.evidence[name].value for name in ("element", "kind") if name in found.evidence]
        error.element, error.kind = (str(text) for text in (*texts, "", "")[:2])
        return error


class BlockedError(KinertiaError):
    """Findings stop a fit: all ERRORs of all trials at once.

    Attributes:
        findings: all findings, including those that did not stop it.

    Examples:
        >>> issubclass(kinertia.BlockedError, kinertia.KinertiaError)
        True
    """

    def __init__(self, findings: Sequence[Finding], blocking: Sequence[Finding]) -> None:
        self.findings = tuple(findings)
        self.blocking = tuple(blocking)
        self.finding = self.blocking[0] if self.blocking else None
        super().__init__("\n".join(f"{blocker.line()} {blocker.remedy}" for blocker in self.blocking))


def findings_of(error: KinertiaError) -> tuple[Finding, ...]:
    """Return all findings that stopped a fit, those of another error, or none."""
    if isinstance(error, BlockedError):
        return error.findings
    every = (error, *error.also) if isinstance(error, FileError) else (error,)
    return tuple(refusal.finding for refusal in every if refusal.finding is not None)
