"""Reads the names in braces out of the catalogue's sentences, as Python's own parser finds them."""

from string import Formatter


def names_in(template):
    return [name for _, name, _, _ in Formatter().parse(template) if name is not None]
