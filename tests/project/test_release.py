"""What a release rests on: one version, one list of requirements, a container without a root user."""

from __future__ import annotations

import re
import shutil
import tomllib
from typing import TYPE_CHECKING

import yaml
from packaging.requirements import Requirement
from release.rehearse import ROOT, disagreements, version

if TYPE_CHECKING:
    from pathlib import Path


def test_one_version_stands_everywhere(tmp_path: Path) -> None:
    assert disagreements() == []
    for file in ("src/tsis/__about__.py", "CITATION.cff", "codemeta.json", "release/conda/recipe.yaml"):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    about = tmp_path / "src" / "tsis" / "__about__.py"
    about.write_text(about.read_text().replace(version(), "9.9.9"))
    assert len(disagreements(tmp_path)) == 3


def test_the_conda_recipe_asks_for_what_the_package_asks_for() -> None:
    recipe = yaml.safe_load((ROOT / "release" / "conda" / "recipe.yaml").read_text("utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    own = {Requirement(text).name: str(Requirement(text).specifier) for text in project["dependencies"]}
    stated = dict(text.split(" ", 1) for text in recipe["requirements"]["run"])
    assert stated.pop("python") == project["requires-python"]
    assert stated == own
    assert recipe["about"]["summary"] == project["description"]


def test_the_container_runs_as_a_user_of_a_pinned_image() -> None:
    lines = (ROOT / "release" / "Containerfile").read_text("utf-8").splitlines()
    instructions = [line.split(maxsplit=1) for line in lines if line and not line.startswith("#")]
    assert [name for name, _ in instructions] == ["FROM", "RUN", "COPY", "RUN", "USER", "WORKDIR", "ENTRYPOINT", "CMD"]
    image = instructions[0][1]
    assert re.fullmatch(r"python:3\.\d+-slim-bookworm", image)  # no address of a registry, no "latest"
    assert dict(instructions)["USER"] not in ("root", "0")


def test_the_paper_has_its_parts_and_invents_nobody() -> None:
    """Headings and length as JOSS asks; each citation has an entry and each entry is cited; authors as CITATION.cff."""
    text = (ROOT / "paper" / "paper.md").read_text("utf-8")
    _, front, body = text.split("---\n", 2)
    entries = re.findall(r"^@\w+\{(\w+),$", (ROOT / "paper" / "paper.bib").read_text("utf-8"), re.MULTILINE)
    headings = re.findall(r"^# (.+)$", body, re.MULTILINE)
    assert headings[:3] == ["Summary", "Statement of need", "State of the field"]
    assert headings[-1] == "References"
    assert 750 <= len(body.split()) <= 1750
    assert set(re.findall(r"@(\w+)", body)) == set(entries)
    assert len(entries) == len(set(entries))
    for picture in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", body):
        assert (ROOT / "paper" / picture).is_file()
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    stated = yaml.safe_load(front)
    assert [author["name"] for author in stated["authors"]] == [author["name"] for author in cited["authors"]]
    assert stated["title"] == cited["title"]
