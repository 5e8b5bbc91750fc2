"""Compiling beside: that what the other process compiles is what the estimate runs."""

from kinertia.cli.compiling import compile_markers
from kinertia.estimation.simultaneous import marker_terms
from kinertia.studies.simulated_people import Scenario, estimate_person
from kinertia.synthetic.faults import Faults


def test_what_is_compiled_beside_is_what_the_estimate_takes():
    """Of the same types: of others it would be compiled twice."""
    estimate_person(0, (Scenario("", Faults("artefact"), walk_s=0.5), 0))
    types = set(marker_terms._add.signatures)
    assert len(types) == 1
    compile_markers()
    assert set(marker_terms._add.signatures) == types
