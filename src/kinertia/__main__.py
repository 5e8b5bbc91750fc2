"""Runs the command as `python -m kinertia`: in new processes, and where Python's scripts folder is not on the path."""

from kinertia.cli.start import program

if __name__ == "__main__":
    program()
