"""Commands that pages tell a reader to type exist, with their options; so do the names that their code imports."""

from __future__ import annotations

from pathlib import Path

import pytest
from release.links import PAGES

from release import commands

ROOT = Path(__file__).parents[2]


def page(folder: Path, text: str) -> Path:
    (folder / "README.md").write_text(text, encoding="utf-8")
    return folder


def test_every_command_and_name_in_the_pages_exists() -> None:
    assert commands.faults(ROOT) == []


def test_no_command_is_overlooked() -> None:
    result = [
        words
        for pattern in PAGES
        for path in ROOT.glob(pattern)
        for kind, text in commands.BLOCK.findall(path.read_text(encoding="utf-8"))
        if kind == "console"
        for words in commands.commands(text)
    ]
    assert len(result) > 100
    assert {"demo", "console", "examine", "study", "records", "sweep"} <= {words[0] for words in result if words}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("```console\n$ tsis demonstrate\n```\n", "there is no command 'demonstrate'"),
        ("```console\n$ .venv/bin/tsis demo --sed 3 # three\n```\n", "there is no option --sed"),
        ("```console\n$ tsis records list --json | tsis records shows 1\n```\n", "there is no command 'shows'"),
        ("```console\n$ tsis study run trial \\\n    --operators Ada\n```\n", "there is no option --operators"),
        ("```console\n$ tsis calibrate --seshion a\n```\n", "there is no option --seshion"),
        ("```python\nfrom tsis.study import nothing_of_the_kind\n```\n", "tsis.study has no nothing_of_the_kind"),
    ],
)
def test_what_does_not_exist_is_found(tmp_path: Path, text: str, said: str) -> None:
    (fault,) = commands.faults(page(tmp_path, text))
    assert said in fault


@pytest.mark.parametrize(
    "text",
    [
        "```console\n$ tsis demo --seed 3 > demo.txt\nwhat it prints --sed\n```\n",
        "```console\n$ tsis study plan --width-mm=60 --height-mm 40\n```\n",
        "```console\n$ python -m tsis --version\n$ grep --count tsis --sed\n```\n",
        "```python\nfrom tsis.study.folder import new_study\nfrom tsis import inclusion\n```\n",
    ],
)
def test_what_exists_is_let_pass(tmp_path: Path, text: str) -> None:
    assert commands.faults(page(tmp_path, text)) == []
