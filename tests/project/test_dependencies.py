"""What a plain install brings: no GPL, and every package pinned by name and version alone."""

from __future__ import annotations

import re
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
# in their wording none of these is the GPL, though the letters are in it
NOT_GPL = re.compile(r"LGPL|Lesser General Public")
# declares the GPL for its mode of the editor Emacs, which its source holds and its wheel does not
GPL_ELSEWHERE = {"docutils"}
GPL = re.compile(r"\bA?GPL|General Public License", re.IGNORECASE)


def _key(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _closure(requirements: list[str]) -> dict[str, metadata.Distribution]:
    """The installed packages that these requirements bring, directly or through others."""
    found: dict[str, metadata.Distribution] = {}
    left = [Requirement(text) for text in requirements]
    while left:
        requirement = left.pop()
        key = _key(requirement.name)
        if key in found or not (requirement.marker is None or requirement.marker.evaluate({"extra": ""})):
            continue
        found[key] = metadata.distribution(requirement.name)
        left += [Requirement(text) for text in found[key].requires or []]
    return found


def _declared(package: metadata.Distribution) -> str:
    fields = package.metadata
    for name in ("License-Expression", "Classifier", "License"):
        entries = [entry for entry in fields.get_all(name) or [] if name != "Classifier" or entry.startswith("License")]
        if entries:
            return "; ".join(entries)
    return ""


@pytest.fixture(scope="module")
def manifest() -> dict[str, dict[str, list[str]]]:
    loaded: dict[str, dict[str, list[str]]] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return loaded


def _direct(manifest: dict[str, Any]) -> list[str]:
    """Requirements of the plain install, of the extras that tests use, and of the group dev."""
    used = re.search(r"^EXTRAS := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert used is not None
    extras = [text for name in used[1].split(",") for text in _extras()[name] if not text.startswith("tsis[")]
    return [*manifest["project"]["dependencies"], *extras, *manifest["dependency-groups"]["dev"]]


def _extras() -> dict[str, list[str]]:
    loaded = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras: dict[str, list[str]] = loaded["project"]["optional-dependencies"]
    return extras


def _pins() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = [line for line in lines if line and not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][A-Za-z0-9.]*", line) for line in pinned)
    return {_key(name): version for name, version in (line.split("==") for line in pinned)}


def test_make_installs_every_extra_that_the_bill_of_materials_lists(manifest: dict[str, Any]) -> None:
    """An extra that only a developer's environment holds is missing on a clean machine."""
    groups = manifest["dependency-groups"]
    used = re.search(r"^EXTRAS := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert used is not None
    brought = [text for name in used[1].split(",") for text in _extras()[name]]
    brought += [text for extra in ("records", "report") for text in _extras()[extra]]  # which the extra console names
    installed = {_key(Requirement(text).name) for text in [*brought, *groups["dev"], *groups["peers"]]}
    needed = {_key(Requirement(text).name) for texts in _extras().values() for text in texts}
    assert needed <= installed


def test_a_plain_install_brings_no_gpl(manifest: dict[str, dict[str, list[str]]]) -> None:
    packages = _closure(manifest["project"]["dependencies"])
    assert {"numpy", "matplotlib", "scikit-image"} <= set(packages)
    for name, package in packages.items():
        licence = _declared(package)
        assert licence, f"{name} declares no licence"
        if name not in GPL_ELSEWHERE:
            assert not GPL.search(NOT_GPL.sub("", licence)), f"{name} is under {licence}"


def test_a_plain_install_brings_at_most_forty_packages(manifest: dict[str, dict[str, list[str]]]) -> None:
    packages = _closure(manifest["project"]["dependencies"])
    assert len(packages) < 40  # and tsis
    heavy = {
        "arviz",
        "xarray",
        "pandas",
        "opencv-python-headless",
        "scikit-learn",
        "statsmodels",
        "sqlalchemy",
        "nicegui",
        "reportlab",
        "pyarrow",
        "pydicom",
    }
    assert heavy.isdisjoint(packages)


def test_no_file_of_docutils_that_is_installed_is_under_the_gpl() -> None:
    package = metadata.distribution("docutils")
    for file in package.files or []:
        if file.suffix in (".py", ".el", ".sty", ".css", ".js"):
            text = Path(str(file.locate())).read_text(encoding="utf-8")
            assert "General Public License" not in text, f"{file} is under the GPL"


def test_every_package_is_pinned(manifest: dict[str, dict[str, list[str]]]) -> None:
    packages = _closure(_direct(manifest))
    missing = sorted(set(packages) - set(_pins()))
    assert not missing, f"constraints.txt does not pin {missing}; run `make constraints`"


@pytest.mark.parametrize("extra", ["analysis", "camera", "cluster", "console", "records", "report", "study"])
def test_these_extras_bring_no_gpl(extra: str) -> None:
    packages = _closure([text for text in _extras()[extra] if not text.startswith("tsis[")])
    assert packages
    for name, package in packages.items():
        assert name in GPL_ELSEWHERE or not GPL.search(NOT_GPL.sub("", _declared(package))), (
            f"{name} is under {_declared(package)}"
        )


def test_the_libraries_page_names_every_direct_dependency(manifest: dict[str, dict[str, list[str]]]) -> None:
    page = (ROOT / "docs" / "decisions" / "0001-libraries.md").read_text(encoding="utf-8")
    groups = [text for group in manifest["dependency-groups"].values() for text in group]
    extras = [text for name, extra in _extras().items() if name != "all" for text in extra]
    for text in manifest["project"]["dependencies"] + extras + groups:
        name = Requirement(text).name
        assert name == "tsis" or f"| {name} |" in page, f"docs/decisions/0001-libraries.md must say why {name} is used"


def test_the_citation_names_the_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {metadata.version('tsis')}" in citation
