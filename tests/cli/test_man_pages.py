"""Man pages, against the parsers and against the help that people see."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from release.man_pages import main, pages
from tests.cli.test_program import parsers

from tsis.cli.app import COMMANDS

if TYPE_CHECKING:
    from pathlib import Path


def test_each_command_has_a_page_with_all_its_options() -> None:
    made = dict(pages())
    assert {f"tsis-{name}.1" for name in COMMANDS} <= set(made)
    for words, parser in parsers().items():
        page = made["-".join(["tsis", *words]) + ".1"].replace("\\-", "-")
        for option in parser.params:
            assert option.hidden or ", ".join(option.opts) in page
        assert "tsis " + " ".join(words[:1]) in page.partition(".SH EXAMPLE")[2]


def test_the_pages_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(tmp_path)
    assert re.search(r"man1: [0-9]+ pages", capsys.readouterr().out)
    assert (tmp_path / "man1" / "tsis-examine.1").read_text(encoding="utf-8").startswith(".TH TSIS-EXAMINE 1")


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("tsis exam", {"examine"}),
        ("tsis records ex", {"export"}),
        ("tsis examine --reference-", {"--reference-press", "--reference-force-n"}),
    ],
)
def test_the_shell_completes_commands_and_options(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], typed: str, offered: set[str]
) -> None:
    from tsis.cli import main as program

    monkeypatch.setenv("_TSIS_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
    monkeypatch.setattr("sys.argv", ["tsis"])
    with pytest.raises(SystemExit):
        program()
    assert set(capsys.readouterr().out.split()) == offered
