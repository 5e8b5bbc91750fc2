"""Ends a command: its results for scripts (`--json`), and its exit status."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import wraps
from typing import Annotated, Any, NoReturn, get_type_hints

import typer

from kinertia.cli.terminal import out, print_json
from kinertia.errors import KinertiaError, findings_of

_AS_JSON = Annotated[bool, typer.Option("--json", help="Print the results as JSON only, for scripts.")]


@dataclass(frozen=True)
class Outcome:
    """Result of a command for scripts, and its exit status.

    Attributes:
        content: result for scripts, as `--json` prints it; paths as text.
        status: exit status.
    """

    content: Mapping[str, Any] | Sequence[Any]
    status: int = 0


def add_command(
    app: typer.Typer, command: Callable[..., Any], name: str | None = None, panel: str | None = None
) -> None:
    """Register a command of `app`; one that returns an `Outcome` gets `--json`, which prints it instead of all text.

    A command that has an `as_json` of its own receives the option, too. `panel` is its heading in `kinertia --help`.
    """
    hints = get_type_hints(command, include_extras=True)
    app.command(name, rich_help_panel=panel)(_with_json(command, hints) if hints["return"] is Outcome else command)


def of_error(error: KinertiaError) -> dict[str, Any]:
    """Return an error for scripts: its text, its findings, and what to do next where that is known."""
    content: dict[str, Any] = {"error": str(error), "findings": [one.to_dict() for one in findings_of(error)]}
    notes = getattr(error, "__notes__", ())
    return {**content, "next": list(notes)} if notes else content


def _with_json(command: Callable[..., Outcome], hints: Mapping[str, Any]) -> Callable[..., NoReturn]:
    signature = inspect.signature(command)
    own = "as_json" in signature.parameters

    @wraps(command)
    def run(*, as_json: bool, **given: Any) -> NoReturn:
        if own:
            given["as_json"] = as_json
        with out.capture() if as_json else nullcontext():
            outcome = command(**given)
        if as_json:
            print_json(outcome.content)
        raise typer.Exit(outcome.status)

    if not own:
        option = inspect.Parameter("as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=_AS_JSON)
        signature = signature.replace(parameters=[*signature.parameters.values(), option])
    annotated = [one.replace(annotation=hints.get(name, _AS_JSON)) for name, one in signature.parameters.items()]
    run.__signature__ = signature.replace(parameters=annotated)  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in annotated}
    return run
