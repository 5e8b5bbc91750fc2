"""`python -m kinertia`: the command where the folder of Python's programs is not on the path, and in new processes."""

from kinertia.cli.start import program

if __name__ == "__main__":
    program()
