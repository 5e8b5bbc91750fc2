"""Defines the command line: one module per command, and what they share; `web` is the page in the browser."""
