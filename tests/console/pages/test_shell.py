"""The frame of the pages: who takes the camera, and the help of every page and field."""

from __future__ import annotations

import ast
import asyncio
import re
import tomllib
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from nicegui import ui
from tests.console.pages.open_page import RecordingViewer, on_a_page

import tsis
from tsis.console.pages import PAGES
from tsis.console.pages.shell import ControlButtons
from tsis.console.services.control import ControlLock, Owner

if TYPE_CHECKING:
    from collections.abc import Callable


class Faster(ControlLock):
    """Bob takes the camera just after somebody saw that nobody holds it."""

    def owner(self) -> Owner | None:
        result = super().owner()
        if result is None:
            self.take("tab 2", "Bob")
        return result


def after(command: Callable[[ControlButtons], Any]) -> tuple[str, list[str]]:
    """Who holds the camera after something was done on a page, and what was complained of there."""
    instrument = SimpleNamespace(control=Faster())
    complaints: list[str] = []

    async def done(viewer: RecordingViewer) -> None:
        waited = command(ControlButtons(instrument, viewer))  # type: ignore[arg-type]
        if waited is not None:
            await waited
        complaints.extend(viewer.complaints)

    on_a_page(instrument, done)
    holder = ControlLock.owner(instrument.control)
    return "" if holder is None else holder.name, complaints


def test_a_page_that_is_open_takes_it_from_nobody() -> None:
    assert after(ControlButtons.report_open) == ("Bob", [])


def test_a_click_on_a_free_camera_takes_it_from_nobody() -> None:
    assert after(ControlButtons._take_control) == ("Bob", ["The camera is controlled by Bob; watch, or take it over."])


def test_who_answers_the_question_takes_it_over() -> None:
    async def requested(buttons: ControlButtons) -> None:
        await buttons._take_control()
        client = buttons._viewer._client

        async def clicked() -> None:
            with client:
                await buttons._take_control()

        again = asyncio.create_task(clicked())
        await asyncio.sleep(0)  # the question is asked now
        (dialog,) = (item for item in client.elements.values() if isinstance(item, ui.dialog))
        assert any(
            str(getattr(item, "text", "")).startswith("Bob is using the camera") for item in dialog.descendants()
        )
        dialog.submit(True)
        await again

    assert after(requested)[0] == "Ann"


CONSOLE = Path(tsis.__file__).parent / "console"
GLOSSARY = Path(__file__).parents[3] / "docs" / "glossary.md"
HELP = tomllib.loads((CONSOLE / "pages" / "help.toml").read_text(encoding="utf-8"))


@cache
def trees() -> dict[str, ast.Module]:
    """The pages' code by file."""
    return {
        file.relative_to(CONSOLE / "pages").as_posix(): ast.parse(file.read_text(encoding="utf-8"))
        for file in sorted((CONSOLE / "pages").rglob("*.py"))
    }


def called(node: ast.AST) -> str:
    """The last part of the name of what is called."""
    function = getattr(node, "func", None)
    return getattr(function, "attr", getattr(function, "id", ""))


def test_every_page_has_a_help_and_its_terms_are_the_glossary_s() -> None:
    listed = [address for address in PAGES if "{" not in address]
    assert [address for address in listed if not HELP.get(address, {}).get("text")] == []
    meanings = dict(re.findall(r"^\| ([^|]+?) \| ([^|]+?) \|", GLOSSARY.read_text(encoding="utf-8"), re.MULTILINE))
    for address in listed:
        for term in HELP[address]["terms"]:
            plain = re.sub(r" \$[^$]*\$|(,? ?\(\d+\.\d+\))+|`", "", meanings[term])
            assert HELP["terms"][term] == plain


def test_every_field_is_explained_with_its_label() -> None:
    """What a field's code calls it has a sentence; labels that are made while the program runs are a browser's test."""
    kinds = {"unit_field", "select_field", "text_field", "text_area", "NumberField", "typed_field"}
    missing = []
    for file, tree in trees().items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or called(node) not in kinds:
                continue
            named = [item.value for item in node.keywords if item.arg == "label"]
            texts = named or node.args[1 if called(node) == "NumberField" else 0 : 2][:1]
            labels = [str(item.value) for item in texts if isinstance(item, ast.Constant) and item.value]
            missing += [f"{file}: {label}" for label in labels if label not in HELP["fields"]]
    assert missing == []
