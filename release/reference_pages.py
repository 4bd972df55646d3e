"""Pages of the reference that follow from the code: every command, call over HTTP, flag and public package."""

from __future__ import annotations

import pkgutil
from typing import TYPE_CHECKING, Any

import typer.main

import tsis
from tsis.calibration.guard.limits import GUARD_FLAGS, GuardLimits
from tsis.cli.app import app
from tsis.console.api.application import api_app
from tsis.console.api.responses import CONTROL
from tsis.hardness.curve_flags import INDENTATION_FLAGS
from tsis.hardness.flags import HARDNESS_FLAGS
from tsis.inclusion.flags import INCLUSION_FLAGS
from tsis.mapping.flags import MAP_FLAGS
from tsis.matching.flags import MATCHING_FLAGS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from tsis.model.flag import Flag

FLAGS: Mapping[str, Mapping[str, Flag]] = {
    "an inclusion": INCLUSION_FLAGS,
    "hardness": HARDNESS_FLAGS,
    "a force curve": INDENTATION_FLAGS,
    "a map": MAP_FLAGS,
    "a match": MATCHING_FLAGS,
}

# in the order of the layers, from the values up
PACKAGES = (
    "model",
    "catalog",
    "errors",
    "files",
    "imaging",
    "optics",
    "mechanics",
    "instrument",
    "matching",
    "calibration",
    "hardness",
    "inclusion",
    "virtual",
    "sweep",
    "records",
    "study",
    "present",
)


def commands() -> str:
    """A table of all commands in Markdown."""
    rows = [
        f"| `tsis {' '.join(words)}` | {summary} |" for words, summary in _commands([], typer.main.get_command(app))
    ]
    return "\n".join(["| command | what it does |", "| --- | --- |", *rows]) + "\n"


def _commands(words: list[str], command: Any) -> Iterator[tuple[list[str], str]]:
    parts = {name: part for name, part in getattr(command, "commands", {}).items() if not part.hidden}
    if words and not parts:
        example, _, text = (command.help or "").partition("\n\n")
        yield words, _summary(command.short_help or text or example)
    for name, part in parts.items():
        yield from _commands([*words, name], part)


def calls() -> str:
    """A table of all calls over HTTP in Markdown, from their description."""
    described = api_app(None, None).openapi()  # type: ignore[arg-type]  # nothing is called
    rows = [
        f"| `{method.upper()} {path}` | {_act(call)}{_summary(call['description'])} |"
        for path, methods in described["paths"].items()
        for method, call in methods.items()
    ]
    return "\n".join(["| call | what it does |", "| --- | --- |", *rows]) + "\n"


def with_flags(page: str) -> str:
    """The page with a table in place of each "(flags of ...)": every flag, as it is declared."""
    for kind, flags in FLAGS.items():
        rows = [
            f"| `{one.name}` | {one.means} | {one.raised} | {one.cure} | {'**no**' if one.withholds else 'yes'} |"
            for one in flags.values()
        ]
        head = ["| flag | what it means | raised | what to do | numbers |", "| --- | --- | --- | --- | --- |"]
        page = page.replace(f"(flags of {kind})", "\n".join(head + rows))
    return page.replace("(flags of a press)", _guard_flags())


def _guard_flags() -> str:
    limits = GuardLimits()
    rows = [
        f"| `{one.name}` | {one.means} | {getattr(limits, one.limit):g} {one.unit}: {one.raised} | {one.needs or '-'} "
        f"| {one.cure} |"
        for one in GUARD_FLAGS.values()
    ]
    head = ["| flag | what it means | limit | also needs | what to do |", "| --- | --- | --- | --- | --- |"]
    return "\n".join(head + rows)


def _act(call: Any) -> str:
    return "Act. " if any(one["name"] == CONTROL and one["required"] for one in call.get("parameters", [])) else ""


def _summary(text: str) -> str:
    return " ".join(text.split("\n\n")[0].split()).replace("|", "\\|")


def packages() -> list[str]:
    """Dotted names of the packages that offer something to programs, each after the one that holds it."""
    found = []
    for name in PACKAGES:
        found.append(f"tsis.{name}")
        found += _below(f"tsis.{name}")
    return found


def _below(name: str) -> list[str]:
    package = __import__(name, fromlist=["__path__"])
    inside = sorted(part.name for part in pkgutil.iter_modules(getattr(package, "__path__", ())) if part.name[0] != "_")
    found: list[str] = []
    for part in inside:
        found += [f"{name}.{part}", *_below(f"{name}.{part}")]
    return found


def interface() -> str:
    """The headings and directives of the programming interface in Markdown."""
    return "\n".join(_section(name) for name in packages())


def _section(name: str) -> str:
    options = "\n   :show-inheritance:" if name == f"{tsis.__name__}.errors" else ""
    hidden = ", ".join(
        f"set_{step}_request" for step in ("fit", "predict", "predict_proba", "score")
    )  # of scikit-learn
    directive = f"```{{eval-rst}}\n.. automodule:: {name}\n   :members:\n   :exclude-members: {hidden}{options}\n```\n"
    return f"{'#' * (name.count('.') + 1)} {name}\n\n{directive}"
