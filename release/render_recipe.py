"""Parses and renders the recipe for conda-forge, as rattler-build does before it builds."""

from pathlib import Path

from rattler_build import Stage0Recipe

text = (Path(__file__).parent / "conda" / "recipe.yaml").read_text(encoding="utf-8")
assert [str(part) for part in Stage0Recipe.from_yaml(text).render()]
