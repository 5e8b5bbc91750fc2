"""Defines the command line: a module per command or two, and what they share; `web` is the page in the browser."""
