"""The list of modules in docs/architecture.md, made from their docstrings: ``python -m release.module_list``."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- modules, made by python -m release.module_list -->", "<!-- end of modules -->"
LAYERS = re.compile(r"^    \"([a-z_ |]+)\",$", re.MULTILINE)  # of the layers in pyproject.toml, the highest first


def packages() -> list[str]:
    """Packages and single modules of tsis, from the lowest layer up."""
    layers = LAYERS.findall((ROOT / "pyproject.toml").read_text(encoding="utf-8").partition("layers = [")[2])
    return [name for layer in reversed(layers) for name in layer.split(" | ")]


def summary(path: Path) -> str:
    """First sentence of a module's docstring on one line; of a long one what stands before its colon."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    sentence = re.split(r"(?<=\.) (?=[A-Z`])", " ".join(text.split("\n\n")[0].split()))[0]
    head, colon, _ = sentence.partition(": ")
    return f"{head}." if colon and len(head.split()) >= 4 and len(sentence.split()) > 12 else sentence


def module_list() -> str:
    """The list in Markdown: a heading a package, a line a module."""
    lines = [BEGIN]
    for name in packages():
        folder = ROOT / "src" / "tsis" / name
        if not folder.is_dir():
            lines += ["", f"**`{name}.py`** {summary(folder.with_suffix('.py'))}"]
            continue
        lines += ["", f"**`{name}/`** {summary(folder / '__init__.py')}", ""]
        for path in sorted(folder.rglob("*.py")):
            inside = path.relative_to(folder).as_posix()
            if inside != "__init__.py":
                lines.append(f"- `{inside.replace('/__init__.py', '/')}`: {summary(path)}")
    return "\n".join([*lines, "", END])


def with_list(text: str) -> str:
    """The text of the page with its list made anew."""
    before, _, rest = text.partition(BEGIN)
    return before + module_list() + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(with_list(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
