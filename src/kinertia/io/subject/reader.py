"""Reads the subject file: one TOML text that states who walked, which files hold the trials, and how to estimate.

    [subject]
    sex = "female"                 # "male" or "female"
    mass_kg = 61.5                 # may be left out where a C3D file carries it; so may height_m
    height_m = 1.68

    [model]
    static = "static.c3d"          # paths are relative to this file
    markers = "plug-in-gait"       # a preset or a TOML file of your own; left out: found from the labels
    # or, in place of both: osim = "scaled.osim"; with calibrate = true its markers and joint centres may move

    [[trial]]                      # as many as there are
    markers = "walk1.trc"          # a C3D file needs no `forces`
    forces = "walk1_grf.mot"
    loads = "walk1_grf.xml"        # ExternalLoads: which column of `forces` is what
    window_s = [0.4, 1.9]          # left out: where every foot on the ground is measured
    belt_speed_m_s = 1.25          # of a treadmill; or "speed.csv": time_s,speed_m_s; left out: by the standing feet

    [settings]                     # every one has a default, see `kinertia.settings.Settings`
    cutoff_hz = 6.0

    [instruments]                  # errors of plates and synchronisation; all may be left out plate_sd_mm = 2.0
    # from a spot check of the centre of pressure session = "instruments.toml"   # what `kinertia instruments` wrote

    [segment.thigh_r]              # what was measured of a segment; as many as there are
    mass_kg = "8.9 +- 0.4"
    source = "DXA"

    [[attached]]                   # what is not body and moves with a segment; as many as there are
    name = "rucksack"
    segment = "torso"
    mass_kg = "unknown"            # or 10.0, or "10 +- 0.5"
    on_scale = false               # whether the person was weighed with it
    com_mm = [-200, 300, 0]

    [prior]
    bsp = "spring/bsp.csv"         # an earlier estimate in place of the literature's

    [diagnostics]                  # for the person; [trial.diagnostics] for the trial above it
    ignore = ["M102"]              # findings that do not count; `waive` for ERRORs that do not stop an estimate

`read_subject` checks all of it and states the line of an error; `kinertia.io.subject.draft` drafts one.
"""

import difflib
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from kinertia.errors import FileError, SettingsError, SubjectError, wrong_entry
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.file_names import command_line, trouble_as_folders
from kinertia.io.subject.tables import TABLES, CodedError, Diagnostics, StudyFile, SubjectFile, shown
from kinertia.io.text.number_table import number_of
from kinertia.io.text.toml_lines import Location, TomlFile, read_toml
from kinertia.model.anthropometry import check_subject
from kinertia.settings import Settings, Table

T = TypeVar("T", bound=Table)
STUDY_FILE = "kinertia.toml"
_FORCES_NEEDED = "one trial at least needs its forces, and no trial here uses them"
_NOT_FOUND = "F101"


def subject_file_in(folder: Path) -> Path:
    """Find the subject file of a folder: `subject.toml`, or the only .toml file there; hidden files do not count.

    Raises:
        FileError: there is none, or several of which none is called subject.toml.
    """
    paths = sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() == ".toml" and path.name[0] != "." and path.name != STUDY_FILE
    )
    named = [path for path in paths if path.name.lower() == "subject.toml"] or paths
    if len(named) == 1:
        return named[0]
    if not named:
        problem, draft = Quantity("holds no subject file"), command_line(["kinertia", "init", str(folder)])
        raise FileError.found(folder, "F108", problem=problem, action=Quantity(f"Draft one: {draft}"))
    listed = ", ".join(path.name for path in named)
    problem = Quantity(f"holds several .toml files ({listed}), none of them subject.toml")
    raise FileError.found(folder, "F108", problem=problem, action=Quantity("Name the subject file itself"))


def read_subject(path: str | Path, to_fit: bool = True) -> SubjectFile:
    """Read and check a subject file, with the overrules of the study file above it.

    Args:
        path: the file.
        to_fit: require what only a fit needs: the sex, for the anthropometric tables.

    Raises:
        FileError: the file is missing, not TOML, or states something impossible (unknown key, missing or
            wrong value, no such trial file, several trials whose names cannot be folders side by side, implausible
            mass); with the line.
    """
    path = Path(path).resolve()
    document = read_toml(path, "a subject file (subject.toml)")
    if "landmarks" in document.content:
        expected = "expected the subject file that names it (markers = ... under [model])"
        raise FileError.of(path, wrong_entry("a marker set", expected))
    result = _validated(SubjectFile, document, path)
    if lack := _incomplete(result, needs_sex=to_fit):
        place, found = lack
        raise FileError.of(path, found, document.line(place) or document.last_line)
    subject = result.subject
    mass_kg = 70.0 if subject.mass_kg is None else subject.mass_kg  # left open: any plausible value
    height_m = 1.7 if subject.height_m is None else subject.height_m
    try:
        check_subject(mass_kg, height_m, subject.sex or "male")
    except SubjectError as error:
        entry, _, expected = str(error).partition(": ")
        known = {"key": Quantity(error.field), "value": Quantity(str(error.value))}
        wrong = error.finding or wrong_entry(entry, expected.rstrip("."), known)
        raise FileError.of(path, wrong, document.line(("subject", error.field))) from error
    if trouble := trouble_as_folders([trial.name for trial in result.trials]):
        index, problem = trouble
        words = {"name": Quantity(shown(result.trials[index].name)), "problem": Quantity(problem)}
        raise FileError.of(path, with_evidence("F192", Where(), words), document.line(("trial", index, "name")))
    return result.model_copy(update={"diagnostics": _of_study(path.parent) + result.diagnostics})


def _of_study(folder: Path) -> Diagnostics:
    """Return what the nearest `kinertia.toml` overrules, in the folder or in one above it."""
    path = next(
        (parent / STUDY_FILE for parent in (folder, *folder.parents) if os.path.isfile(parent / STUDY_FILE)), None
    )
    if path is None:
        return Diagnostics()
    return _validated(StudyFile, read_toml(path, f"a study file ({STUDY_FILE})"), path).diagnostics


def _validated(kind: type[T], document: TomlFile, path: Path) -> T:
    try:
        return kind.model_validate(document.content, context={"folder": path.parent})
    except ValidationError as error:
        # a trial with an error in it does not count, so that pydantic also finds too few trials
        errors = [problem for problem in error.errors() if problem["type"] != "too_short" or not problem["input"]]
        # a key that is not known explains one that is missing
        errors = [problem for problem in errors if problem["type"] == "extra_forbidden"] or errors
        lines = [(document.line(problem["loc"]) or document.last_line, _finding(problem)) for problem in errors]
        first, *others = sorted(lines, key=lambda line: (line[0], line[1].message))
        refusal = FileError.of(path, first[1], first[0])
        if first[1].code == _NOT_FOUND:  # where a folder was moved, all of its files are missing
            refusal.also = tuple(FileError.of(path, found, line) for line, found in others if found.code == _NOT_FOUND)
        raise refusal from None


def subject_from_options(content: Mapping[str, Any]) -> SubjectFile:
    """Build a subject file from a dictionary of its form, as the command line makes it; paths are relative to here.

    Raises:
        SettingsError: an entry is missing or wrong, or a file does not exist; the message states the entry.
    """
    try:
        result = SubjectFile.model_validate(content, context={"folder": Path.cwd()})
    except ValidationError as error:
        raise SettingsError.of(_finding(error.errors()[0])) from None
    if lack := _incomplete(result):
        raise SettingsError.of(lack[1])
    return result


def _incomplete(wanted: SubjectFile, needs_sex: bool = True) -> tuple[Location, Finding] | None:
    """Return the place and finding of entries that are missing, or not allowed, for the kind of model."""
    model = wanted.model
    if needs_sex and wanted.subject.sex is None and model.osim is None:
        return ("subject", "sex"), _no_sex(wanted)
    if lack := _two_models(model.static, model.markers, model.osim, model.calibrate):
        return lack
    if all(trial.use == "kinematics" for trial in wanted.trials):
        known = {"key": Quantity("use"), "value": Quantity(shown("kinematics"))}
        return ("trial", 0, "use"), wrong_entry(f"use = {shown('kinematics')}", _FORCES_NEEDED, known)
    if model.osim is not None and not wanted.settings.uses.opensim_models:
        method = f"method = {shown(wanted.settings.method)} (which works on the built-in model only)"
        return ("settings", "method"), _conflict(method, "osim in [model]")
    return None


def _no_sex(wanted: SubjectFile) -> Finding:
    """Return the finding that the sex is missing, and what else is, where no C3D file may state it."""
    found = _finding({"loc": ("subject", "sex"), "type": "missing"})
    files = [wanted.model.static, *(trial.markers for trial in wanted.trials)]
    if any(file is not None and file.suffix.lower() == ".c3d" for file in files):
        return found
    more = [key for key in ("mass_kg", "height_m") if getattr(wanted.subject, key) is None]
    if not more:
        return found
    entry = "[subject] lacks " + ", ".join(f"'{key}'" for key in ("sex", *more))
    return replace(found, evidence={**found.evidence, "entry": Quantity(entry), "expected": Quantity("add them")})


def expect_one_model(static: Path | None, markers: str | Path | None, osim: Path | None, calibrate: bool) -> None:
    """Raise an error for entries of [model] that do not go together.

    Raises:
        SettingsError: they belong to the built-in and to an OpenSim model (F193).
    """
    if lack := _two_models(static, markers, osim, calibrate):
        raise SettingsError.of(lack[1])


def _two_models(
    static: Path | None, markers: str | Path | None, osim: Path | None, calibrate: bool
) -> tuple[Location, Finding] | None:
    """Return the place and finding of entries that belong to the other kind of model."""
    if osim is not None:
        for key, given in (("static", static), ("markers", markers)):
            if given is not None:
                return ("model", key), _conflict("osim", f"{key} in [model] (the OpenSim model contains it already)")
    elif calibrate:
        built_in = "a static trial (the built-in model is always calibrated)"
        return ("model", "calibrate"), _conflict("calibrate in [model]", built_in)
    return None


def _conflict(key: str, other: str) -> Finding:
    return finding("F193", one=Quantity(key), other=Quantity(other))


def with_settings(wanted: SubjectFile, **values: Any) -> SubjectFile:
    """Return the subject file with other settings.

    Raises:
        SettingsError: a value is impossible.
    """
    try:
        settings = Settings.model_validate({**wanted.settings.model_dump(), **values})
    except ValidationError as error:
        detail = error.errors()[0]
        raise SettingsError.of(_finding({**detail, "loc": ("settings", *detail["loc"])})) from None
    changed = wanted.model_copy(update={"settings": settings})
    if lack := _incomplete(changed):
        raise SettingsError.of(lack[1])
    return changed


def _finding(detail: Any) -> Finding:
    """Convert one of pydantic's errors to a finding: F191 with entry, expectation, key and value, or its own code."""
    *holder, key = detail["loc"]
    error = detail.get("ctx", {}).get("error")
    if isinstance(error, CodedError):
        return replace(error.found, evidence={**error.found.evidence, "key": Quantity(str(key))})
    known = {"key": Quantity(str(key))}
    if "input" in detail:
        known["value"] = Quantity(shown(detail["input"]))
    return wrong_entry(*_entry_and_expectation(detail, [str(part) for part in holder], str(key)), known)


def _entry_and_expectation(detail: Any, holder: list[str], key: str) -> tuple[str, str]:
    kind, top = detail["type"], (*holder, key)[0]
    names = [part for part in holder if not part.isdigit()]
    table = next((name for name in reversed(names) if name in TABLES), top)
    heading = f"[[{table}]]" if table in ("trial", "attached") else f"[{table}]"
    if kind == "extra_forbidden":
        fields = list(TABLES[table].model_fields) if holder else list(TABLES)
        near = difflib.get_close_matches(key, fields, n=1)
        hint = f"the nearest is '{near[0]}'" if near else f"known are {', '.join(fields)}"
        return f"unknown key '{key}'" + (f" in [{'.'.join(names)}]" if names else ""), hint
    if top == "segment" and len(detail["loc"]) < 3:
        return "[segment]", "every segment is a table of its own under a heading like [segment.thigh_r]"
    if top in ("trial", "attached") and (not holder or key.isdigit()) and kind != "missing":
        what = "trial" if top == "trial" else "attached item"
        return heading, f"every {what} is a table of its own under the heading [[{top}]], in double brackets"
    if not holder:
        return heading, "there is no such heading; add it, with its entries below"
    if kind == "missing":
        return f"{heading} lacks '{key}'", f"add it ({TABLES[table].model_fields[key].description})"
    return f"{key} = {shown(detail['input'])}", _expectation(detail)


def _expectation(detail: Any) -> str:
    """Describe what a value must be."""
    kind = detail["type"]
    if kind == "value_error":
        return str(detail["ctx"]["error"])
    if kind == "bool_type":
        return "must be true or false, without quotes"
    expected = re.sub("^(Input|String) should", "must", detail["msg"]).replace("'", '"')
    if kind == "float_type" and isinstance(detail["input"], str):
        with suppress(ValueError):
            expected += f"; write it without quotes: {number_of(detail['input']):g}"
    return expected
