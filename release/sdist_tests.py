"""The tests of the released sdist, run on the installed wheel: `make test-sdist`, after `make release`.

    python -m release.sdist_tests build/release [--python PYTHON ...] [--plain] [TESTS ...]

For each interpreter: a new environment with the wheel, its extras and the test tools at the pinned versions; the sdist
unpacked elsewhere and without its `src`, so that only the installed package can be imported; then `tsis demo`, and the
quick tests. Prints a line for each interpreter and ends with 1 where one fails.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

from release.extras import PLAIN, installed

EXTRAS = "analysis,camera,cluster,console,curves,dicom,map,postgres,study"
CORE = tuple(
    f"tests/{name}" for name in ("model", "files", "mechanics", "optics", "imaging", "inclusion", "cli", "matching")
)
QUICK = "not system and not slow and not release"
TOOLS = ("pytest", "pytest-xdist", "hypothesis")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Result of one interpreter: version, place of the package, demo's exit code, pytest's last line and exit code."""

    python: str
    package: str
    demo: int
    tests: str
    code: int

    def line(self) -> str:
        """The outcome as one line."""
        return f"Python {self.python}, {self.package}: demo ended with {self.demo}; tests: {self.tests}"


def unpacked(sdist: Path, folder: Path) -> Path:
    """The sdist's files without the package's source."""
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    (top,) = folder.iterdir()
    shutil.rmtree(top / "src")
    return top


def environment(wheel: Path, tests: Path, folder: Path, *, python: str, tools: tuple[str, ...]) -> Path:
    """The programs of a new environment of an interpreter with the wheel and what its tests need."""
    programs = installed(wheel, EXTRAS if not tools else PLAIN, folder, python=python)
    pip = [str(programs / "python"), "-m", "pip", "install", "--quiet", "--constraint", str(tests / "constraints.txt")]
    subprocess.run([*pip, "--upgrade", "pip"], check=True)  # old ones know no groups
    subprocess.run([*pip, *(tools or ["--group", f"{tests / 'pyproject.toml'}:dev"])], check=True)
    return programs


def outcome(archives: Path, folder: Path, *, python: str, tests: tuple[str, ...], tools: tuple[str, ...]) -> Outcome:
    """Install and test in a new folder."""
    (wheel,), (sdist,) = archives.glob("*.whl"), archives.glob("*.tar.gz")
    root = unpacked(sdist, folder / "sdist")
    programs = environment(wheel, root, folder / "environment", python=python, tools=tools)
    where = "import platform, tsis; print(platform.python_version(), tsis.__file__)"
    asked = subprocess.run([programs / "python", "-c", where], cwd=root, check=True, capture_output=True, text=True)
    version, package = asked.stdout.split(maxsplit=1)
    if not Path(package.strip()).is_relative_to(folder / "environment"):
        raise RuntimeError(f"the tests must import the installed package; they import {package.strip()}")
    demo = subprocess.run([programs / "tsis", "demo"], cwd=folder, check=False, capture_output=True, text=True)
    command = [str(programs / "pytest"), "-q", "-p", "no:cacheprovider", "-m", QUICK, *tests]
    run = subprocess.run(command, cwd=root, check=False, capture_output=True, text=True)
    last = (run.stdout.strip().splitlines() or [run.stderr.strip()[-200:]])[-1]
    if run.returncode:
        print(run.stdout[-8000:], run.stderr[-2000:], sep="\n")
    short = Path(package.strip()).parent.relative_to(folder / "environment")
    summary = re.sub(r"=+", "", last).strip()
    return Outcome(python=version, package=str(short), demo=demo.returncode, tests=summary, code=run.returncode)


def main() -> int:
    """Print a line for each interpreter."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("archives", type=Path, help="folder with one wheel and one sdist")
    parser.add_argument("--python", action="append", help="an interpreter; repeat it for several")
    parser.add_argument("--plain", action="store_true", help="the plain install, and the test tools alone")
    parser.add_argument("tests", nargs="*", default=CORE, help="by default those of the core packages")
    options = parser.parse_intermixed_args()
    failed = False
    for python in options.python or [sys.executable]:
        with tempfile.TemporaryDirectory(prefix="tsis-sdist-") as folder:
            found = outcome(
                options.archives.resolve(),
                Path(folder),
                python=python,
                tests=tuple(options.tests),
                tools=TOOLS if options.plain else (),
            )
        print(found.line(), flush=True)
        failed |= bool(found.demo or found.code)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
