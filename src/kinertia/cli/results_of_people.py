"""Finds folders of results: of `kinertia fit`, of a cohort, or folders that contain such folders."""

from dataclasses import dataclass
from pathlib import Path

from kinertia.cli.terminal import out
from kinertia.cohort.tables import fitted_people
from kinertia.errors import FileError
from kinertia.io.text.csv_file import inert
from kinertia.report.exports.saved_fit import FIT_FILE


@dataclass(frozen=True)
class PersonResults:
    """Folder of one person's results, and the person's name in a cohort; None in results of `kinertia fit`."""

    folder: Path
    name: str | None = None


def results_of_people(results: list[Path]) -> list[PersonResults]:
    """List every person's results in these folders, each once; reports those that a cohort no longer lists."""
    found: list[PersonResults] = []
    for path in results:
        if (path / FIT_FILE).is_file():
            found.append(PersonResults(path))
        elif people := sorted(path.glob(f"people/*/{FIT_FILE}")):
            listed = fitted_people(path)
            for folder in (one.parent for one in people):
                if listed is None or inert(folder.name) in listed:
                    found.append(PersonResults(folder, folder.name))
                else:
                    older = "has no current results according to people.csv, only older ones"
                    out.print(f"left out: {folder.name}: {older}", soft_wrap=True)
        elif people := sorted(path.glob(f"*/{FIT_FILE}")):
            found += [PersonResults(one.parent) for one in people]
        else:
            raise FileError(path, "holds no results of kinertia cohort or kinertia fit")
    return list(dict.fromkeys(found))
