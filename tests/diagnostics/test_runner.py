"""Questions are asked, causes explain consequences, and users overrule: nothing else hides a finding."""

from hypothesis import given
from hypothesis import strategies as st

from kinertia.diagnostics.runner import Check, asked, blocking, explained, overruled, unknown_codes
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.findings.rule import all_rules
from kinertia.settings import Overrule

PLACES = st.builds(Where, trial=st.sampled_from([None, "walk", "run"]), plate=st.sampled_from([None, "left", "right"]))
FINDINGS = st.lists(st.builds(finding, st.sampled_from(sorted(all_rules())), PLACES), max_size=12)
ZEROS = st.lists(st.builds(finding, st.sampled_from(["P212", "P213", "P214", "P215"]), PLACES), min_size=3, max_size=8)
"""What would explain one another in a circle, were a correction to resolve what explains it."""

DRIFT = finding("P211", Where(trial="walk", plate="left"), drift_n=Quantity(30.0, "N"))
ZERO = finding("P213", Where(trial="walk", plate="left"), Severity.ERROR, level_n=Quantity(50.0, "N"))
OTHER_ZERO = finding("P213", Where(trial="walk", plate="right"), level_n=Quantity(20.0, "N"))


def test_a_cause_mutes_its_consequence_and_takes_over_its_severity():
    drift, zero, other = explained([DRIFT, ZERO, OTHER_ZERO])
    assert (drift.severity, drift.muted_by) == (Severity.ERROR, None)
    assert zero.muted_by == "P211"
    assert (other.muted_by, other.severity) == (None, Severity.WARNING)
    assert blocking([drift, zero, other]) == [drift]


def test_equal_causes_take_over_the_severity_alike():
    dead = [finding("P101", Where(trial="walk", plate=plate)) for plate in ("left", "right")]
    far = finding("R203", Where(part="mass of torso"), Severity.ERROR)
    assert [reported.severity for reported in explained([*dead, far])[:2]] == [Severity.ERROR, Severity.ERROR]


def test_what_is_found_in_a_trial_left_out_explains_nothing_elsewhere():
    """The result is that of the other trials."""
    fixed = finding("P251", Where(trial="walk", plate="left"))
    far, zero = finding("R203", Where(part="mass of torso"), Severity.ERROR), ZERO.at(Severity.WARNING)
    assert [reported.muted_by for reported in explained([fixed, far])] == [None, "P251"]
    assert [reported.muted_by for reported in explained([fixed, far, DRIFT, zero], ["walk"])] == [
        None,
        None,
        None,
        "P211",
    ]


def test_the_order_of_findings_does_not_matter():
    for order in ([ZERO, DRIFT], [DRIFT, ZERO]):
        assert {reported.code: reported.muted_by for reported in explained(order)} == {"P211": None, "P213": "P211"}


def test_a_finding_twice_is_one():
    assert len(explained([DRIFT, DRIFT])) == 1


def test_a_waived_cause_unblocks_what_it_explains():
    findings = overruled(explained([DRIFT, ZERO]), Overrule(waive=("P211",)))
    assert blocking(findings) == []
    assert [reported.status for reported in findings] == ["waived", "open"]


def test_a_waived_cause_does_not_unblock_what_leaves_nothing_to_compute():
    beside, none, short = (finding(code, Where(trial="walk")) for code in ("P244", "P278", "P279"))
    findings = overruled(explained([beside, none, short]), Overrule(waive=("P244",)))
    assert [(reported.code, reported.status, reported.muted_by) for reported in findings[:2]] == [
        ("P244", "waived", None),
        ("P278", "open", None),
    ]
    assert [reported.code for reported in blocking(findings)] == ["P278"]


def test_what_was_found_of_all_plates_is_not_said_to_go_unnoticed():
    """Of plates whose rotation of 2.8 degrees was corrected it was said that 2.2 degrees would not show."""
    found = [finding("P234"), finding("P235"), finding("P247", Where(axis="fore-aft"))]
    hidden = [finding("P248", Where(axis=axis)) for axis in ("fore-aft", "mediolateral")]
    assert [reported.muted_by for reported in explained([*found, *hidden])] == [None, "P234", None, "P247", None]


def test_what_is_ignored_still_explains():
    weak = finding("P213", Where(trial="walk", plate="left"), level_n=Quantity(20.0, "N"))
    drift, zero = overruled(explained([DRIFT, weak]), Overrule(ignore=("P21",)))
    assert (drift.status, zero.muted_by) == ("ignored", "P211")


def test_what_turns_out_to_be_an_error_later_is_ignored_no_more():
    """An ignored dead channel hid nine implausible parameters, which it explained."""
    dead = finding("P101", Where(trial="walk", plate="left"))
    far = finding("R203", Where(part="mass of torso"), Severity.ERROR)
    ignore = Overrule(ignore=("P101",))
    before = overruled(explained([dead]), ignore)
    assert [reported.status for reported in before] == ["ignored"]
    assert [reported.code for reported in blocking(overruled(explained([*before, far]), ignore))] == ["P101"]


def test_errors_are_not_ignored_and_hard_ones_not_waived():
    hard = finding("P278", Where(trial="walk"))
    assert overruled([ZERO, hard], Overrule(("P278",), ("P213",))) == [ZERO, hard]
    assert unknown_codes(Overrule(("P278", "P244", "X1"), ("P21", "P999"))) == ["X1", "P999", "P278"]


def test_a_correction_resolves_the_warning_about_the_same_plate():
    warning = finding("P213", Where(trial="walk", plate="left"), level_n=Quantity(20.0, "N"))
    resolving = next(
        resolving_rule
        for resolving_rule in all_rules().values()
        if "P213" in resolving_rule.resolves or "P212" in resolving_rule.resolves
    )
    code = next(resolved for resolved in resolving.resolves if resolved in ("P212", "P213"))
    warned = finding(code, warning.where, level_n=Quantity(20.0, "N"))
    corrected = finding(resolving.code, Where(trial="walk", plate="left"), zero_offset_n=Quantity(6.0, "N"))
    result = {reported.code: reported for reported in explained([warned, corrected])}
    assert (result[code].severity, result[code].muted_by) == (Severity.CORRECTED, resolving.code)


def test_a_question_without_meaning_is_not_asked():
    calls = []

    def ask(context: str):
        calls.append(context)
        return [OTHER_ZERO]

    wrong_axis = finding("P201", Where(trial="walk"))
    assert asked([Check(("P21",), ask, unless=("P20",))], "walk", [wrong_axis]) == []
    assert asked([Check(("P21",), ask, unless=("P24",))], "walk", [wrong_axis]) == [OTHER_ZERO]
    assert calls == ["walk"]


def test_findings_without_a_trial_are_of_the_one_asked():
    (found,) = asked([Check(("P21",), lambda _: [finding("P211", drift_n=Quantity(1.0, "N"))])], None, (), "walk")
    assert found.where.trial == "walk"


@given(st.lists(st.sampled_from(sorted(all_rules())), max_size=8), st.booleans())
def test_no_finding_is_lost_and_one_of_the_worst_stays_open(codes: list[str], same_trial: bool):
    findings = [finding(code, Where(trial="walk" if same_trial else f"walk {k}")) for k, code in enumerate(codes)]
    result = explained(findings)
    assert {(reported.code, reported.where) for reported in result} == {
        (reported.code, reported.where) for reported in findings
    }
    if findings and max(reported.severity for reported in findings) is Severity.ERROR:
        assert blocking(result)
    assert all(reported.muted_by in {other.code for other in result} for reported in result if reported.muted_by)


@given(FINDINGS | ZEROS)
def test_every_chain_of_causes_ends_in_a_finding_that_nothing_explains(findings):
    """Of a crosstalk of 5 %, a zero explained an unknown force, that a correction, and the correction the zero."""
    result = explained(findings)
    for last_effect in result:
        chain = [last_effect]
        while chain[-1].muted_by is not None:
            last = chain[-1]
            causes = [
                reported
                for reported in result
                if reported.code == last.muted_by and reported.where.overlaps(last.where)
            ]
            assert causes, last
            chain.append(min(causes, key=lambda cause: cause.muted_by is not None))
            assert len(chain) <= len(result), [reported.code for reported in chain]
    assert all(reported.severity >= Severity.CORRECTED for reported in result if reported.code == "P215")


def test_a_correction_that_only_the_corrected_warning_explains_is_the_end_of_the_chain():
    place = Where(trial="walk", plate="left")
    zero, force, corrected = (finding(code, place) for code in ("P212", "P214", "P215"))
    result = {reported.code: reported for reported in explained([zero, force, corrected])}
    assert {code: reported.muted_by for code, reported in result.items()} == {
        "P212": "P215",
        "P214": "P212",
        "P215": None,
    }
    assert result["P212"].severity is Severity.CORRECTED
