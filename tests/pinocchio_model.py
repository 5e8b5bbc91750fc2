"""Pinocchio as the oracle of the rigid-body core; tests that need it are skipped where it has no wheels."""

import pytest

pin = pytest.importorskip("pinocchio", reason="Pinocchio has no wheels for this system")

from validation.pinocchio_skeleton import axis_forces, pinocchio_model  # noqa: E402

__all__ = ["axis_forces", "pin", "pinocchio_model"]
