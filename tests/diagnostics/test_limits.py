"""Limits of findings: just below each nothing is found, or less; just above, it is.

Values are written out, so that a limit that changes shows here; each pair has to enclose the limit that its check
declares. Limits that no case can try by itself are listed with where they are tested.
"""

import pickle
import re

import pytest

from file_limits import FILE_LIMITS
from kinertia.diagnostics.limits import ALL_CHECKS, limits_of, names_in, with_limits
from kinertia.diagnostics.runner import in_order
from kinertia.findings.rule import all_rules
from marker_limits import MARKER_LIMITS
from person_limits import PERSON_LIMITS
from plate_limits import PLATE_LIMITS
from result_limits import RESULT_LIMITS

CASES = {**FILE_LIMITS, **MARKER_LIMITS, **PLATE_LIMITS, **PERSON_LIMITS, **RESULT_LIMITS}
USED = {(code, name) for code, entry in all_rules().items() for name in names_in(entry)}
"""Codes and names of limits in texts of the catalogue."""
NOT_TRIED = {
    "F122": "largest smallest",
    "F153": "misses",
    "F171": "farthest",
    "F181": "fastest",
    "F182": "longest shortest",
    "M173": "moved",
    "O411": "share",
    "O413": "light",
    "S402": "distance",
    "S403": "distance",
    "S404": "distance",
    "T104": "frames",
    "T106": "step",
    "L108": "ankle knee",
    "L207": "behind beyond",
    "L213": "segment",
    "M121": "times",
    "M123": "interpolated",
    "M133": "certain quick ratio share",
    "M144": "steep tilted",
    "M145": "farther",
    "M151": "exact",
    "M161": "moved moved_between moved_share",
    "M163": "drifting",
    "M171": "backwards",
    "M172": "torso",
    "M175": "knee",
    "O104": "least most",
    "O212": "distance",
    "O215": "ratio",
    "O304": "axis",
    "O311": "clamped",
    "O312": "beyond share",
    "O402": "plainly",
    "O405": "distance",
    "P107": "times",
    "P109": "horizontal lasts vertical",
    "P212": "of_one",
    "P214": "force window",
    "P216": "level moment",
    "P221": "gain",
    "P222": "large larger small smaller",
    "P232": "away moment opposed",
    "P233": "best reversed_share",
    "P236": "best misread",
    "P241": "far",
    "P242": "wrong",
    "P243": "back begin beside end far forward offset",
    "P266": "lever_arm",
    "P272": "loading middle",
    "P273": "shortest",
    "P276": "outside share",
    "P279": "frames",
    "P282": "edge hallux overhang",
    "P287": "proportional",
    "P288": "log_odds",
    "P290": "frames",
    "P291": "window",
    "R106": "lost",
    "R112": "share",
    "R204": "chance",
    "R205": "asymmetry",
    "R305": "impossible",
    "S201": "walk",
    "S203": "certain mass reapplied session stature typical",
    "S204": "session",
    "S205": "apart errors standing",
    "S209": "ankle_apart ankle_axis ankle_from foot foot_from knee_axis",
    "T201": "growth least_ratio most_ratio of_few vertical_growth",
    "T213": "window",
    "T216": "difference",
    "T311": "apart",
}
"""Names of limits by code whose evidence no single number makes up: they judge fits, whole motions, or what readers and
the preparation of trials decide. The tests of their checks try the codes farther from their limits."""


def tried(key):
    """Code and name of the limit that a case tries: "P213 zero; of a child"."""
    code, name = key.partition(";")[0].split()
    return code, name


@pytest.mark.parametrize("key", CASES)
def test_limits(key, monkeypatch):
    check, within, beyond, few, more, *_ = CASES[key]
    code, _ = tried(key)
    for value, expected in ((within, few), (beyond, more)):
        patched = [monkeypatch] * ("patched" in check.__code__.co_varnames[: check.__code__.co_argcount])
        found = [finding.severity.name for finding in check(value, *patched) if finding.code == code]
        assert found == expected, value


@pytest.mark.parametrize("key", CASES)
def test_cases_enclose_the_limit_that_is_declared(key):
    _, within, beyond, _, _, *at = CASES[key]
    code, name = tried(key)
    limit = limits_of(code)[name]
    value = at[0](limit) if at else limit
    assert min(within, beyond) <= value <= max(within, beyond)


def test_every_limit_is_tried_or_listed():
    assert {tried(key) for key in CASES} <= USED
    assert USED - {tried(key) for key in CASES} == {
        (code, name) for code, names in NOT_TRIED.items() for name in names.split()
    }


def test_every_limit_that_is_declared_is_in_a_text():
    """Else nobody reads it."""
    unread = [
        (check.codes, name)
        for check in ALL_CHECKS
        for name in check.limits
        if not USED & {(code, name) for code in check.codes}
    ]
    assert unread == []


NUMBERS = (
    "F106 F115 F181 M111 M112 M116 M175 P107 P215 P223 P231 P234 P236 P237 "
    "P242 P246 P267 P282 R107 R305 S111 S113 S306 T214 T215"
)
"""Codes whose texts have numerals: numbers of SDs, of frequencies and of rotations, and what formats and tables say."""


def test_numbers_of_texts_are_those_of_limits():
    """One that is written out would not change with the check."""
    texts = {code: f"{entry.detects} {entry.escalation}" for code, entry in all_rules().items()}
    written = {code: re.sub(r"\{[^}]*\}|\b[A-Z]+\d\w*\b", "", text) for code, text in texts.items()}
    assert {code for code, text in written.items() if re.search(r"\d", text)} == set(NUMBERS.split())


def test_texts_have_no_names_left():
    assert [
        entry.code for entry in map(with_limits, all_rules().values()) if "{" in entry.detects + entry.escalation
    ] == []


def test_checks_run_after_those_that_may_make_them_meaningless():
    checks = tuple(reversed(ALL_CHECKS))
    order = in_order(tuple(dict.fromkeys(checks)))
    assert all(not check.needs(later) for k, check in enumerate(order) for later in order[k:])


def test_a_limit_is_the_same_in_another_process():
    limit = limits_of("P105")["force_step"]
    other = pickle.loads(pickle.dumps(limit))
    assert (other, other.unit, other.usual) == (limit, limit.unit, limit.usual)
