"""Stores the arrays of a long trial, which do not fit into memory, in a temporary file."""

import mmap
import tempfile
from typing import IO

import numpy as np

from kinertia.errors import KinertiaError

_ALIGNED = mmap.ALLOCATIONGRANULARITY
"""Groups begin at multiples of it in the file (bytes), as mapping them requires."""


class KeptArrays:
    """Groups of arrays in a temporary file, which is created with the first group and deleted with this object.

    >>> kept = KeptArrays()
    >>> kept.add(np.arange(3.0), np.ones((2, 2), np.float32))
    >>> [array.tolist() for array in kept.get(0)]
    [[0.0, 1.0, 2.0], [[1.0, 1.0], [1.0, 1.0]]]
    """

    def __init__(self) -> None:
        self._file: IO[bytes] | None = None
        self._groups: list[tuple[int, list[tuple[tuple[int, ...], np.dtype[np.generic]]]]] = []

    def add(self, *arrays: np.ndarray) -> None:
        """Append a group to the file.

        Raises:
            KinertiaError: the disk has no room for it.
        """
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile()  # noqa: SIM115  # it lives as long as this object
            begin = self._file.seek(0, 2)
            for array in arrays:
                self._file.write(np.ascontiguousarray(array).data)
            self._file.write(bytes(_ALIGNED - self._file.tell() % _ALIGNED))
            self._file.flush()
        except OSError as error:
            raise KinertiaError(
                f"a long trial needs some 150 MB a minute in the folder for temporary files, {tempfile.gettempdir()}, "
                f"which cannot be written ({error.strerror}): make room there, or set TMPDIR (Windows: TEMP) to another"
            ) from error
        self._groups.append((begin, [(array.shape, array.dtype) for array in arrays]))

    def get(self, k: int) -> list[np.ndarray]:
        """Return group k, which is read where it is used; what is written to it does not reach the file."""
        assert self._file is not None
        begin, kinds = self._groups[k]
        sizes = [int(np.prod(shape)) * dtype.itemsize for shape, dtype in kinds]
        mapped = mmap.mmap(self._file.fileno(), sum(sizes), access=mmap.ACCESS_COPY, offset=begin)
        starts = np.cumsum([0, *sizes[:-1]]).tolist()
        return [np.ndarray(shape, dtype, mapped, start) for start, (shape, dtype) in zip(starts, kinds, strict=True)]
