"""The catalogue of texts: what the pages show goes through `tr`, and every catalogue has it with its values."""

from __future__ import annotations

import ast
import re
import string
import tomllib
from functools import cache
from pathlib import Path

import pytest
from tests.console.pages.open_page import on_a_page

import tsis
from tsis.console._catalogues import CATALOGUES, catalogue
from tsis.console.auth._login_routes import login_page
from tsis.console.pages import PAGES
from tsis.console.pages.components import languages, plain_message, tr

CONSOLE = Path(tsis.__file__).parent / "console"
GLOSSARY = Path(__file__).parents[3] / "docs" / "glossary.md"
HELP = tomllib.loads((CONSOLE / "pages" / "help.toml").read_text(encoding="utf-8"))
SHOWING = {"label", "muted", "panel", "button", "link", "switch", "tab", "panel_title", "checkbox", "expansion"}
SHOWING |= {"notify", "complain", "title_row", "cell", "list_message", "titled_dialog"}
WORD = re.compile(r"[A-Za-z]{3}")
NAMES = {"tsis", "tsis console", "3-D"}  # the same in every language
OTHERS = sorted(set(languages()) - {"en"})


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


def constants(node: ast.AST) -> set[str]:
    """The texts that stand in an expression."""
    found = {item.value for item in ast.walk(node) if isinstance(item, ast.Constant)}
    return {item for item in found if isinstance(item, str)}


def named(tree: ast.Module) -> dict[str, ast.expr]:
    """What the names of a module's constants stand for."""
    assigned = [node for node in tree.body if isinstance(node, ast.Assign)]
    return {target.id: node.value for node in assigned for target in node.targets if isinstance(target, ast.Name)}


def meant(node: ast.expr, tree: ast.Module) -> set[str]:
    """The texts that an expression may be: a text, one of two, one of a module's constants, or one of many there."""
    if isinstance(node, ast.IfExp):
        return meant(node.body, tree) | meant(node.orelse, tree)
    if isinstance(node, ast.Name):
        return meant(named(tree)[node.id], tree) if node.id in named(tree) else set()
    if isinstance(node, ast.Subscript):
        return meant(node.value, tree)
    if isinstance(node, ast.Dict):
        return {text for value in node.values for text in meant(value, tree)}
    if isinstance(node, ast.Tuple):
        return {text for value in node.elts for text in meant(value, tree)}
    return {node.value} if isinstance(node, ast.Constant) and isinstance(node.value, str) else set()


def translated_texts() -> set[str]:
    """Texts that the code gives to `tr`, and those that are translated where they are placed."""
    auth = [ast.parse(file.read_text(encoding="utf-8")) for file in sorted((CONSOLE / "auth").glob("*.py"))]
    nodes = [(node, tree) for tree in (*trees().values(), *auth) for node in ast.walk(tree)]
    placed = ("tr", "rows_under", "_page", "refusal")
    firsts = [(node.args[0], tree) for node, tree in nodes if isinstance(node, ast.Call) and called(node) in placed]
    return {text for first, tree in firsts for text in meant(first, tree)} - {""}


def help_said() -> set[str]:
    """Every text of the help: of the pages, of their fields, and the terms that they use."""
    pages = [part for name, part in HELP.items() if name.startswith("/")]
    said = [text for page in pages for text in (*page["text"], *page["terms"], *page.get("fields", {}).values())]
    meant = {term: text for term, text in HELP["terms"].items() if term in said}
    return {*said, *meant.values(), *HELP["fields"], *HELP["fields"].values()}


def fields(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


@pytest.mark.parametrize("code", OTHERS)
def test_a_catalogue_has_every_text_with_its_values(code: str) -> None:
    texts = catalogue(code)._texts
    assert translated_texts() - NAMES - set(texts) == set()
    assert help_said() - set(texts) == set()
    assert [text for text, other in texts.items() if fields(text) != fields(other)] == []
    assert [text for text, other in texts.items() if not other.strip()] == []


@pytest.mark.parametrize("code", OTHERS)
def test_a_catalogue_has_nothing_that_no_code_says(code: str) -> None:
    source = "".join(file.read_text(encoding="utf-8") for file in CONSOLE.parent.rglob("*.py"))
    said = re.sub(r'"\s*\n\s*f?"', "", source) + (CONSOLE / "pages" / "help.toml").read_text(encoding="utf-8")
    assert [text for text in catalogue(code)._texts if text not in said and text.lower() not in said] == []


def untranslated(node: ast.AST) -> set[str]:
    """Words of an expression that no `tr` translates; names of what is asked for are none."""
    if called(node) in ("tr", "count_text") or isinstance(node, (ast.Compare, ast.Subscript)):
        return set()
    if isinstance(node, ast.Call):
        return set().union(*(untranslated(item) for item in node.args))
    if isinstance(node, ast.IfExp):
        return untranslated(node.body) | untranslated(node.orelse)
    if isinstance(node, ast.Constant):
        return {node.value} if isinstance(node.value, str) and WORD.search(node.value) else set()
    return set().union(*(untranslated(item) for item in ast.iter_child_nodes(node)))


def test_every_shown_text_is_translated() -> None:
    """By file, texts of shown parts that no `tr` translates: none."""
    left = {}
    for file, tree in trees().items():
        nodes = list(ast.walk(tree))
        given = [node.args[0] for node in nodes if isinstance(node, ast.Call) and called(node) in SHOWING and node.args]
        texts = {name for name, value in named(tree).items() if isinstance(value, (ast.Constant, ast.JoinedStr))}
        set_later = [
            node.value
            for node in nodes
            if isinstance(node, ast.Assign) and any(getattr(target, "attr", "") == "text" for target in node.targets)
        ]
        found = set().union(*(untranslated(node) for node in (*given, *set_later)))
        found |= {node.id for node in given if isinstance(node, ast.Name) and node.id in texts}
        left[file] = found - NAMES
    assert {file: words for file, words in left.items() if words} == {}


def test_another_language_is_what_the_browser_chose() -> None:
    assert tr("Target {number}", number=7) == "Target 7"
    assert catalogue("de").gettext("Target {number}").format(number=7) == "Ziel 7"
    assert catalogue("de").gettext("no such text") == "no such text"
    assert languages() == {"en": "English", "de": "Deutsch"}
    assert sorted(file.stem for file in CATALOGUES.iterdir()) == OTHERS


def test_ranges_are_refused_in_the_language_of_the_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tsis.console.pages.components._language.chosen_language", lambda: "de")
    assert plain_message("gain must lie in [0, 24]; got -5 (dB)") == "Gain muss 0–24 dB sein (Sie haben −5 eingegeben)."
    assert plain_message("seed must lie in [0, inf]; got ''") == "Seed muss 0 oder mehr sein (nichts wurde eingegeben)."


def test_the_login_is_in_the_language_of_the_browser() -> None:
    def shown(cookie: str) -> str:
        page = login_page(then="/", requested={"cookie": cookie}, wrong="")
        return bytes(page.body).decode()

    german, english = shown("a=b; tsis-language=de"), shown("tsis-language=../../etc")
    assert '<html lang="de">' in german
    assert "<h1>An der Konsole anmelden</h1>" in german
    assert "<button>Anmelden</button>" in german
    assert '<html lang="en">' in english
    assert "<h1>Log in to the console</h1>" in english


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
        if file.startswith("components/"):
            continue
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or called(node) not in kinds:
                continue
            named = [item.value for item in node.keywords if item.arg == "label"]
            texts = named or node.args[1 if called(node) == "NumberField" else 0 : 2][:1]
            labels = [str(item.value) for item in texts if isinstance(item, ast.Constant) and item.value]
            missing += [f"{file}: {label}" for label in labels if label not in HELP["fields"]]
    assert missing == []


def test_texts_of_a_page_without_a_browser_are_english() -> None:
    said = []

    async def done(_: object) -> None:
        said.append(tr("Camera"))

    on_a_page(None, done)
    assert said == ["Camera"]
