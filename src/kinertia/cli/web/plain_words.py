"""Says in the page's words what a subject file lacks."""

from __future__ import annotations

import os
import re
from typing import NamedTuple

from kinertia.cli.web.entries import label_of
from kinertia.cli.web.library import Person

_CHOOSE = "choose one in the table above, or add its file"
_PLAIN = (
    (re.compile(r"\[model\] lacks 'static'"), f"No file is used as the static trial: {_CHOOSE}."),
    (
        re.compile(r"\[\[trial\]\](: there is no such heading| lacks 'markers')"),
        f"No file is used as a walk: {_CHOOSE}.",
    ),
)
_MISSING = re.compile(r"\[subject\] lacks '(\w+)'")


class Told(NamedTuple):
    """A trouble: in plain words, empty where it is plain as it is; and as the command line says it."""

    plain: str
    exact: str


def told(person: Person, trouble: str) -> Told:
    """The trouble with a person's subject file, which is named without its folder."""
    exact = trouble.replace(f"{person.folder}{os.sep}", "")
    if missing := _MISSING.search(exact):
        return Told(f"{label_of(missing[1])} is missing: fill it in, then save and check.", exact)
    return Told(next((plain for pattern, plain in _PLAIN if pattern.search(exact)), ""), exact)
