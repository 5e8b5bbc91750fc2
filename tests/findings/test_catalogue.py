"""The catalogue as a whole: every code has a complete entry, and no finding explains itself."""

import ast
import re
from pathlib import Path

import kinertia
from kinertia.findings.finding import Severity
from kinertia.findings.rule import FAMILIES, STAGES, all_rules, family_title, matching, questions, rule
from refusals import MOST_WORDS
from template_names import names_in

RULES = all_rules()
QUESTIONS = {question for family in FAMILIES for question in questions(family)}
OUTPUTS = {"motion", "moments", "masses", "centres_of_mass", "inertias"}
NO_EVIDENCE = {"code", "where", "severity", "causes"}
"""Arguments of `finding`: evidence cannot have these names."""


def explained(code):
    """Codes whose findings are said to be a consequence of this one's."""
    return {consequence for entry in rule(code).supersedes for consequence in matching(entry)}


def templates(entry):
    return (entry.message, entry.effect, entry.remedy)


def codes_where(condition):
    return [code for code, entry in RULES.items() if condition(entry)]


def test_every_question_has_answers_and_every_answer_a_question():
    assert {entry.question for entry in RULES.values()} == QUESTIONS
    assert all(question[0] == family and len(question) == 3 for family in FAMILIES for question in questions(family))
    assert all(family_title(family) for family in FAMILIES)


def test_names_are_unique_words():
    assert len({entry.name for entry in RULES.values()}) == len(RULES)
    assert codes_where(lambda entry: not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)+", entry.name)) == []


def test_severities_stages_and_outputs_are_known():
    assert codes_where(lambda entry: entry.severity not in Severity.__members__) == []
    assert codes_where(lambda entry: entry.stage not in STAGES) == []
    assert codes_where(lambda entry: not set(entry.affects) <= OUTPUTS) == []


def test_everything_is_said_in_sentences():
    assert codes_where(lambda entry: not all(re.fullmatch(r"\S(.*\S)?\.", text) for text in templates(entry))) == []
    assert codes_where(lambda entry: not re.fullmatch(r"[A-Z\[].*\S\.", entry.detects)) == []


def test_messages_are_short():
    assert codes_where(lambda entry: len(re.sub(r"\{[^}]*\}", "x", entry.message).split()) > MOST_WORDS) == []


def test_remedies_are_one_sentence():
    assert codes_where(lambda entry: re.search(r"[.!?] [A-Z]", entry.remedy)) == []


def test_what_a_reader_raises_cannot_be_waived():
    """A file that cannot be read further gives nothing to compute with, whatever the user overrules."""
    paths = Path(kinertia.__file__).parent.rglob("*.py")
    calls = [node for path in paths for node in ast.walk(ast.parse(path.read_text("utf-8"))) if _is_raised(node)]
    constants = {node.value for call in calls for node in ast.walk(call) if isinstance(node, ast.Constant)}
    raised = constants & set(RULES)
    assert len(raised) > 40
    assert sorted(code for code in raised if not rule(code).hard and not rule(code).by_readers) == []
    assert [code for code in codes_where(lambda entry: entry.by_readers) if code not in raised or rule(code).hard] == []


def _is_raised(node):
    """Whether a node makes an error of a code: FileError.found(path, "F104"), OsimError.about(...)."""
    function = node.func if isinstance(node, ast.Call) else None
    kind = getattr(getattr(function, "value", None), "id", "")
    return kind.endswith("Error") and function.attr in ("found", "of", "about")


def test_braces_hold_names_of_evidence_or_places():
    for finding in RULES.values():
        for template in templates(finding):
            assert not set("{}") & set(re.sub(r"\{[a-z][a-z0-9_]*(:\+?[%#]?)?\}", "", template)), finding.code
            assert not set(names_in(template)) & NO_EVIDENCE, finding.code


def test_what_may_be_a_warning_or_error_affects_some_output():
    def grave(entry):
        return entry.severity in ("WARNING", "ERROR") or bool(re.search("WARNING|ERROR", entry.escalation))

    # norms are shown beside results and change none
    assert codes_where(lambda entry: grave(entry) != bool(entry.affects)) == ["F187"]


def test_only_errors_are_hard():
    assert codes_where(lambda entry: entry.hard and entry.severity != "ERROR" and "ERROR" not in entry.escalation) == []


def test_what_a_rule_explains_and_resolves_is_known():
    assert codes_where(lambda entry: not set(entry.supersedes) <= RULES.keys() | QUESTIONS) == []
    assert codes_where(lambda entry: not set(entry.resolves) <= RULES.keys()) == []
    assert codes_where(lambda entry: len(set(entry.supersedes)) < len(entry.supersedes)) == []


def test_only_corrections_resolve_and_only_warnings_are_resolved():
    assert codes_where(lambda entry: entry.resolves and entry.severity != "CORRECTED") == []
    assert codes_where(lambda entry: any(rule(code).severity != "WARNING" for code in entry.resolves)) == []


def test_no_finding_explains_itself_by_way_of_others():
    settled = set()

    def follow(code, way):
        assert code not in way, " > ".join([*way, code])
        if code not in settled:
            for consequence in explained(code):
                follow(consequence, [*way, code])
            settled.add(code)

    for code in RULES:
        follow(code, [])


def test_no_finding_explains_why_a_file_cannot_be_read():
    assert codes_where(lambda finding: any(rule(code).stage == "file" for code in explained(finding.code))) == []
