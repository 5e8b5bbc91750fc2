"""Runs the command as `python -m kinertia`: in new processes, and where Python's scripts folder is not on the path.

Nothing is imported from the current folder, which Python puts first: a file coverage.py there is somebody's data.
"""

import sys

if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]
    from kinertia.cli.start import program

    program()
