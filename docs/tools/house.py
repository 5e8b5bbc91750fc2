"""Draw the house, `docs/figures/house.svg`, from the contract in `pyproject.toml`, and list its rooms.

    python docs/tools/house.py

A test compares picture and page with the contract and the rooms' docstrings.
"""

import ast
import tomllib
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "figures" / "house.svg"
PAGE = ROOT / "docs" / "architecture.md"
_WIDTH, _HEIGHT, _GAP = 760, 44, 12


def layers() -> list[list[str]]:
    """Rooms from the roof down; those of one floor do not know each other."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (contract,) = [candidate for candidate in contracts if candidate["type"] == "layers"]
    return [floor.split(" | ") for floor in contract["layers"]]


def purpose(room: str) -> str:
    """First line of a room's docstring."""
    package = ROOT / "src" / "kinertia" / room
    path = package / "__init__.py" if package.is_dir() else package.with_suffix(".py")
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n")[0]


def drawn() -> str:
    """The picture."""
    floors = layers()
    height = len(floors) * (_HEIGHT + _GAP) + _GAP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" font-family="sans-serif">',
        "<title>The rooms of Kinertia: each imports from those below it only</title>",
    ]
    for number, floor in enumerate(floors):
        y, width = _GAP + number * (_HEIGHT + _GAP), (_WIDTH - _GAP) / len(floor) - _GAP
        for k, room in enumerate(floor):
            x = _GAP + k * (width + _GAP)
            parts.append(
                f'<rect x="{x:g}" y="{y}" width="{width:g}" height="{_HEIGHT}" rx="4" fill="#e8f1f8" stroke="#0072B2"/>'
                f'<text x="{x + width / 2:g}" y="{y + 28}" font-size="18" text-anchor="middle">{escape(room)}</text>'
            )
    return "\n".join([*parts, "</svg>"]) + "\n"


def table() -> str:
    """The rooms with what they are for, as a table of the page."""
    rows = [f"| `{room}` | {purpose(room)} |" for floor in layers() for room in floor]
    return "\n".join(["| room | what is in it |", "|---|---|", *rows])


def filled(text: str) -> str:
    """The text of the page with the table as the rooms are now."""
    start, end = "<!-- rooms -->\n", "<!-- end -->"
    before, _, rest = text.partition(start)
    return f"{before}{start}\n{table()}\n\n{end}{rest.partition(end)[2]}"


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
