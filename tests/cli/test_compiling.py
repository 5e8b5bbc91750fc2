"""Compiling beside: that what the other process compiles is what the estimate runs."""

from dataclasses import replace

from kinertia.cli.compiling import compile_markers
from kinertia.estimation.simultaneous import marker_terms
from kinertia.studies.accuracy import PROOF, run_draw


def test_what_is_compiled_beside_is_what_the_estimate_takes():
    """Of the same types: of others it would be compiled twice."""
    run_draw(0, (replace(PROOF["artefact"], walk_s=0.5), 0))
    types = set(marker_terms._add.signatures)
    assert len(types) == 1
    compile_markers()
    assert set(marker_terms._add.signatures) == types
