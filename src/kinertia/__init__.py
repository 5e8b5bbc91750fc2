"""Body segment parameters from gait: motion-capture markers and ground reaction forces in, BSPs out."""

from importlib.metadata import version

__version__ = version("kinertia")
