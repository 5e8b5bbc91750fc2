"""Two alike walks and squats of one person, with forces that are late or another trial's."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.io.opensim.reader import read_osim
from kinertia.model.imported_model import markers_of_model
from kinertia.model.marker_set import MarkerSet
from kinertia.settings import Subject
from kinertia.trial.data import Recording
from recordings import is_here


class Person(NamedTuple):
    """Names of files (`recordings`) and of trials: two walks, then squats."""

    folder: str
    model: str
    trials: tuple[str, str, str]
    mass_kg: float

    def files(self, name: str, forces: str | None = None) -> tuple[str, str]:
        """Markers of the trial of this name, and forces of this one or another."""
        return f"{self.folder}/{name}.trc", f"{self.folder}/{forces or name}_grf.mot"


_KNOWN = {
    "synthetic": Person("synthetic", "synthetic/scaled.osim", ("walk", "alike", "squats"), 72.6),
    "subject4": Person("subject4", "subject4/addbiomechanics_scaled.osim", ("walking1", "walking2", "squats1"), 60.0),
}
PEOPLE = {name: person for name, person in _KNOWN.items() if is_here(person.model)}


class Trials:
    """Trials of one person.

    Args:
        person: who.
        file_of, recording_of: the fixtures.
    """

    def __init__(self, person: Person, file_of: Callable[[str], Path], recording_of: Callable[..., Recording]) -> None:
        self.person, self.read = person, recording_of
        self.marker_set: MarkerSet = markers_of_model(read_osim(file_of(person.model)))

    @property
    def names(self) -> tuple[str, str, str]:
        return self.person.trials

    def context(self, name: str, forces: str | None = None, delay_s: float = 0.0) -> RecordingContext:
        """The recording of this name.

        Args:
            name: of the trial.
            forces: the trial whose forces it has; its own if None.
            delay_s: by how much they are late.
        """
        recording = self.read(*self.person.files(name, forces))
        plates = replace(recording.plates, time=recording.plates.time + delay_s)
        return RecordingContext(replace(recording, plates=plates, name=name), self.marker_set)

    def together(self, contexts: Sequence[RecordingContext]) -> PersonContext:
        """The person with these recordings."""
        return PersonContext(Subject(mass_kg=self.person.mass_kg), contexts, marker_set=self.marker_set)
