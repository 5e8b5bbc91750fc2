"""Renders pages of finished results: the letter, comparisons of people and of conditions; makes the library's norms."""

from collections.abc import Sequence

from kinertia.cli.learning import norms_text
from kinertia.cli.web.library import Library, PersonFolder
from kinertia.errors import KinertiaError
from kinertia.estimation.result.mean_cycles import Control, band_columns
from kinertia.io.norms_file import read_norms
from kinertia.io.output_folder import write_then_rename
from kinertia.report.comparison.side_by_side import render_comparison
from kinertia.report.comparison.what_changed import compare, compared_sessions
from kinertia.report.exports.saved_fit import load_fit, read_saved
from kinertia.report.pages.page import render


def letter(person: PersonFolder, library: Library) -> str:
    """Render the two pages for a patient's file, with the library's norms if it has any."""
    saved = read_saved(person.results)
    norms = read_norms(library.norms) if library.norms.is_file() else {}
    return render(saved.fit, saved.provenance, saved.versions, norms, saved.truth, template="letter")


def people_compared(people: Sequence[PersonFolder], library: Library) -> str:
    """Render what changed between two results, and several side by side."""
    fits = {person.name: load_fit(person.results) for person in people}
    found, reason = compared_sessions(list(fits.values()), norms=library.norms if library.norms.is_file() else None)
    return render_comparison(fits, None if found is None else found.shown(), reason)


def conditions_compared(person: PersonFolder, conditions: tuple[str, str], library: Library) -> str:
    """Render what changed between two conditions of one session."""
    norms = library.norms if library.norms.is_file() else None
    return compare(person.results, conditions=conditions, norms=norms).page()


def make_norms(people: Sequence[PersonFolder], library: Library) -> None:
    """Write the library's norms from the results of these people, one per control.

    Raises:
        KinertiaError: a person has no strides, two results are of one recording, models differ, or there is one person.
    """
    controls: list[Control] = []
    seen: dict[str, str] = {}
    for person in people:
        saved = read_saved(person.results)
        files = {} if saved.provenance is None else dict.fromkeys(saved.provenance.files.values(), person.name)
        if again := [seen[one] for one in files if one in seen]:
            raise KinertiaError(f"{person.name} and {again[0]} share recordings: choose each control once")
        seen |= files
        controls.append(Control.of(saved.fit))
    write_then_rename(library.norms, norms_text(band_columns(controls)))
