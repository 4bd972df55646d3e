"""A release, rehearsed: `make release`. Nothing is uploaded.

Checks that one version stands everywhere, builds the archives twice from a clean copy of the last commit, compares
them byte for byte, checks the metadata and what the wheel holds, and writes hashes beside the archives.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from email import message_from_bytes
from pathlib import Path

from packaging.metadata import Metadata

ROOT = Path(__file__).parents[1]
SUMS = "SHA256SUMS"
IN_WHEEL = ("tsis/py.typed", "tsis/catalog/probes.toml", "tsis/tables/")
LARGEST_WHEEL_MB = 12.0


def version(root: Path = ROOT) -> str:
    """The version of the package, as its source states it."""
    text = (root / "src" / "tsis" / "__about__.py").read_text(encoding="utf-8")
    found = re.search(r'^__version__ = "([^"]+)"$', text, re.MULTILINE)
    assert found is not None
    return found[1]


def disagreements(root: Path = ROOT) -> list[str]:
    """Files that state another version than the package, a sentence each."""
    own = version(root)
    stated = {
        "CITATION.cff": re.findall(r"^version: (\S+)$", (root / "CITATION.cff").read_text("utf-8"), re.MULTILINE),
        "codemeta.json": [json.loads((root / "codemeta.json").read_text("utf-8"))["version"]],
        "release/conda/recipe.yaml": re.findall(
            r'^  version: "([^"]+)"$', (root / "release" / "conda" / "recipe.yaml").read_text("utf-8"), re.MULTILINE
        ),
    }
    return [f"{file} must state version {own}; it states {names}" for file, names in stated.items() if names != [own]]


def clean_copy(folder: Path) -> Path:
    """The files of the last commit, in a new folder."""
    folder.mkdir(parents=True)
    archive = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", str(folder)], input=archive, check=True)
    return folder


def built(source: Path, out: Path) -> dict[str, str]:
    """Build sdist and wheel; SHA-256 by file name. Times inside are that of the last commit."""
    when = subprocess.run(["git", "log", "-1", "--format=%ct"], cwd=ROOT, check=True, capture_output=True, text=True)
    environment = os.environ | {"SOURCE_DATE_EPOCH": when.stdout.strip()}
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(source)]
    subprocess.run(command, check=True, capture_output=True, env=environment)
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(out.iterdir())}


def faults_of_wheel(path: Path) -> list[str]:
    """What is wrong with a wheel's metadata and contents, a sentence each."""
    with zipfile.ZipFile(path) as wheel:
        names = wheel.namelist()
        (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        raw = wheel.read(metadata)
    Metadata.from_email(raw, validate=True)
    faults = [f"the wheel must hold {part}" for part in IN_WHEEL if not any(name.startswith(part) for name in names)]
    foreign = sorted({name.split("/")[0] for name in names if not name.startswith(("tsis/", "tsis-"))})
    if foreign:
        faults.append(f"the wheel must hold the package alone; it holds {', '.join(foreign)}")
    if message_from_bytes(raw)["Version"] != version():
        faults.append(f"the wheel must be of version {version()}; it is of {message_from_bytes(raw)['Version']}")
    megabytes = path.stat().st_size / 1e6
    if megabytes > LARGEST_WHEEL_MB:
        faults.append(f"the wheel must have at most {LARGEST_WHEEL_MB:g} MB; it has {megabytes:.1f}")
    return faults


def rehearse(out: Path) -> list[str]:
    """Build twice and check; what is wrong, a sentence each. The archives and their hashes are left in ``out``."""
    shutil.rmtree(out, ignore_errors=True)
    first, second = (built(clean_copy(out / "source" / name), out / name) for name in ("first", "second"))
    faults = disagreements()
    faults += [
        f"{name} must have the same bytes each time it is built" for name in first if first[name] != second[name]
    ]
    (wheel,) = (out / "first").glob("*.whl")
    faults += faults_of_wheel(wheel)
    for name in first:
        shutil.copy(out / "first" / name, out / name)
    (out / SUMS).write_text("".join(f"{digest}  {name}\n" for name, digest in first.items()), encoding="utf-8")
    for part in ("source", "first", "second"):
        shutil.rmtree(out / part)
    return faults


def main(out: Path) -> None:
    """Rehearse, print the hashes, and end with 1 where something is wrong."""
    faults = rehearse(out)
    if faults:
        raise SystemExit("\n".join(faults))
    print((out / SUMS).read_text(encoding="utf-8"), end="")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
