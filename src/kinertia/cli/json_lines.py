"""Writes the progress of a long run for programs: one JSON object per line on standard output."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import typer

from kinertia.cli.terminal import finite

_EVERY_S = 1.0


class JsonLines:
    """Events of a run; says nothing unless they are wanted."""

    def __init__(self, wanted: bool) -> None:
        self.wanted = wanted

    def say(self, event: str, **content: Any) -> None:
        """One line: the name of the event, and what belongs to it; what is not a finite number is null."""
        if self.wanted:
            typer.echo(json.dumps({"event": event, **finite(content)}, allow_nan=False))

    def with_progress(self, shown: Callable[[str, float], None]) -> Callable[[str, float], None]:
        """What shows progress, and says it here: at the start and the end of a stage, and once a second between."""
        stage_now, began, said = "", 0.0, 0.0

        def progress(stage: str, share: float) -> None:
            nonlocal stage_now, began, said
            shown(stage, share)
            now = time.monotonic()
            new = stage != stage_now
            if new:
                stage_now, began = stage, now
            if new or share >= 1.0 or now - said >= _EVERY_S:
                said = now
                left_s = (now - began) * (1.0 - share) / share if share > 0.0 else None
                self.say("progress", stage=stage, share=round(share, 4), left_s=left_s and round(left_s, 1))

        return progress
