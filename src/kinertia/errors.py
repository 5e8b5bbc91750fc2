"""Errors that a user can act on: what was found, where, what was expected, what to do.

Every error that Kinertia raises on purpose derives from `KinertiaError` and carries the data of its message as
attributes. The command line prints the message as one line and exits with status 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


class KinertiaError(Exception):
    """Base of all errors raised on purpose; `str(error)` is one complete sentence for the user.

    Examples:
        >>> try:
        ...     kinertia.read_recording("walk.trc")
        ... except kinertia.KinertiaError as error:
        ...     print(type(error).__name__)
        FileError
    """

    def __reduce__(self) -> tuple[object, ...]:
        """Back from another process as it was: errors are not made anew of their message alone."""
        return _restored, (type(self), self.args, self.__dict__)


def _restored(kind: type[KinertiaError], args: tuple[object, ...], data: dict[str, object]) -> KinertiaError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(data)
    return error


class FileError(KinertiaError):
    """A file is missing, unreadable, or not what its name says.

    Attributes:
        path: the file.
        line: one-based line number where the trouble was found, or None.
        problem: what was found, what was expected and what to do.

    Examples:
        >>> error = kinertia.FileError("subject.toml", "unknown key 'mas_kg'; did you mean 'mass_kg'?", line=3)
        >>> str(error), error.line
        ("subject.toml, line 3: unknown key 'mas_kg'; did you mean 'mass_kg'?", 3)
    """

    def __init__(self, path: str | Path, problem: str, line: int | None = None) -> None:
        self.path = Path(path)
        self.line = line
        self.problem = problem
        where = f"{self.path}" if line is None else f"{self.path}, line {line}"
        super().__init__(f"{where}: {problem}")


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


class SubjectError(KinertiaError):
    """A subject's mass, height or sex is missing or cannot be true.

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
        super().__init__(f"{field} = {value}: {problem}")


class PriorError(KinertiaError):
    """A prior of body segment parameters that cannot be: a deviation that is not positive, an impossible covariance.

    Attributes:
        parameter: "segment.parameter" that is wrong, or None.
    """

    def __init__(self, problem: str, parameter: str | None = None) -> None:
        self.parameter = parameter
        super().__init__(f"prior of body segment parameters: {problem}")


class SettingsError(KinertiaError):
    """An entry of the subject file or an option of the command line is missing or cannot be.

    Examples:
        >>> isinstance(kinertia.SettingsError("cutoff_hz must be positive"), kinertia.KinertiaError)
        True
    """


class SessionError(KinertiaError):
    """What trials say of plates and clock cannot be put together with what others say.

    Examples:
        >>> isinstance(kinertia.SessionError("plates are told by their names"), kinertia.KinertiaError)
        True
    """


class OsimError(FileError):
    """An OpenSim model file cannot be used: broken, of an unknown format, or a model that Kinertia cannot represent.

    Attributes:
        element: name of the joint, body, marker or constraint it is about; empty where it is the file as a whole.
        kind: the element's type, for example "EllipsoidJoint".

    Examples:
        >>> kinertia.OsimError("scaled.osim", "a joint that closes a loop", 120, element="knee_r").element
        'knee_r'
    """

    def __init__(self, path: str | Path, problem: str, line: int | None = None, element: str = "", kind: str = ""):
        self.element = element
        self.kind = kind
        super().__init__(path, problem, line)
