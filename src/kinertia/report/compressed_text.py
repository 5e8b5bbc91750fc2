"""Compresses texts that a page carries; `templates/unpack.js` reads them."""

from __future__ import annotations

import base64
import gzip


def packed(text: bytes, level: int = 6) -> str:
    """The text in gzip and base64; the same text gives the same letters, at a level from 1 (fast) to 9 (small)."""
    return base64.b64encode(gzip.compress(text, level, mtime=0)).decode("ascii")
