"""Writes what archives and conda-forge read, from `CITATION.cff` and `pyproject.toml`: nothing is stated twice.

`python release/metadata.py` writes `.zenodo.json`, `codemeta.json` and `release/conda/recipe.yaml`.
"""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[1]


def written() -> dict[str, str]:
    """Return the text of each file by its path."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return {
        ".zenodo.json": _json(_zenodo(citation)),
        "codemeta.json": _json(_codemeta(citation, project)),
        "release/conda/recipe.yaml": _recipe(citation, project),
    }


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _abstract(citation: dict[str, Any]) -> str:
    return " ".join(citation["abstract"].split())


def _zenodo(citation: dict[str, Any]) -> dict[str, Any]:
    return {
        "title": citation["title"],
        "description": _abstract(citation),
        "creators": [{"name": author["name"]} for author in citation["authors"]],
        "license": citation["license"],
        "keywords": citation["keywords"],
        "upload_type": "software",
        "access_right": "open",
    }


def _codemeta(citation: dict[str, Any], project: dict[str, Any]) -> dict[str, Any]:
    urls = project["urls"]
    return {
        "@context": "https://w3id.org/codemeta/3.0",
        "@type": "SoftwareSourceCode",
        "name": project["name"],
        "description": _abstract(citation),
        "version": str(citation["version"]),
        "author": [{"@type": "Organization", "name": author["name"]} for author in citation["authors"]],
        "license": f"https://spdx.org/licenses/{citation['license']}",
        "keywords": citation["keywords"],
        "programmingLanguage": "Python",
        "runtimePlatform": f"Python {project['requires-python']}",
        "operatingSystem": [
            classifier.split(" :: ")[-1] for classifier in project["classifiers"] if "Operating" in classifier
        ],
        "codeRepository": urls["Homepage"],
        "issueTracker": urls["Issues"],
        "softwareHelp": urls["Documentation"],
        "softwareRequirements": [dependency.partition(";")[0].strip() for dependency in project["dependencies"]],
    }


def _recipe(citation: dict[str, Any], project: dict[str, Any]) -> str:
    needed = sorted({_conda(dependency) for dependency in project["dependencies"] if "<" not in dependency})
    oldest = project["requires-python"].removeprefix(">=")
    return f"""\
# Written by release/metadata.py for conda-forge/staged-recipes; the hash is the index's, once the version is there.
# All that it needs to run has a feedstock on conda-forge; of the tests' tools axe-playwright-python has none.
schema_version: 1

context:
  version: "{citation["version"]}"
  python_min: "{oldest}"

package:
  name: {project["name"]}
  version: ${{{{ version }}}}

source:
  url: https://pypi.org/packages/source/k/kinertia/kinertia-${{{{ version }}}}.tar.gz
  sha256: "{"0" * 64}"

build:
  number: 0
  noarch: python
  script: ${{{{ PYTHON }}}} -m pip install . -vv --no-deps --no-build-isolation
  python:
    entry_points:
      - kinertia = {project["scripts"]["kinertia"]}

requirements:
  host:
    - python ${{{{ python_min }}}}.*
    - pip
    - hatchling
    - hatch-vcs
  run:
    - python >=${{{{ python_min }}}}
{chr(10).join(f"    - {dependency}" for dependency in needed)}

tests:
  - python:
      imports:
        - kinertia
      python_version:
        - ${{{{ python_min }}}}.*
        - "*"
  - script:
      - kinertia demo -o out

about:
  homepage: {project["urls"]["Homepage"]}
  summary: {project["description"]}
  license: {project["license"]}
  license_file: LICENSE
  documentation: {project["urls"]["Documentation"]}

extra:
  recipe-maintainers:
    - PLACEHOLDER
"""


def _conda(requirement: str) -> str:
    """Return a requirement in conda's words; `plotly>=6.0; sys_platform == ...` is `plotly >=6.0`."""
    name, bounds = re.fullmatch(r"([\w.-]+)\s*([^;]*)(?:;.*)?", requirement).groups()  # type: ignore[union-attr]
    return f"{name} {bounds.strip()}".strip()


if __name__ == "__main__":
    for name, text in written().items():
        (ROOT / name).parent.mkdir(parents=True, exist_ok=True)
        (ROOT / name).write_text(text, encoding="utf-8")
