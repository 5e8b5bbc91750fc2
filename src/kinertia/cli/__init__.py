"""The command line: one module per command, and what the commands share; in `web` the page in the browser."""
