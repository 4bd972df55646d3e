"""Links of the pages: every one that stays in the repository points at a file, and at a heading, that exists.

Addresses of other sites are left alone; where a network exists, `sphinx-build -b linkcheck docs FOLDER` asks for them.
"""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import unquote

if TYPE_CHECKING:
    from pathlib import Path

PAGES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "paper/*.md", "docs/**/*.md")
BUILT = "docs/_build"
DEEPEST = 2  # level of headings that get an anchor in the built pages, as docs/conf.py has it
_FENCE = re.compile(
    r"^(?P<mark>`{3,}|~{3,})(?P<kind>[^\n`]*)\n(?P<body>.*?)^(?P=mark)[ \t]*$", re.DOTALL | re.MULTILINE
)
_CODE = re.compile(r"(?<!`)(`+)(?!`).+?(?<!`)\1(?!`)", re.DOTALL)
_INLINE = re.compile(r"\]\(\s*<?(?P<to>[^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")
_DEFINED = re.compile(r"^\[[^\]]+\]:\s*<?(?P<to>[^\s>]+)", re.MULTILINE)
_HEADING = re.compile(r"^(?P<level>#{1,6})[ \t]+(?P<title>.+?)[ \t]*#*$", re.MULTILINE)
_LABEL = re.compile(r"^\((?P<name>[^)\s]+)\)=$", re.MULTILINE)
_ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)


class Link(NamedTuple):
    """What a page points at, and whether it names a page of the documentation without its ending."""

    to: str
    page: bool = False


def faults(root: Path) -> list[str]:
    """What is wrong with the links of a repository, one sentence each; empty when nothing is."""
    pages = [path for path in _pages(root) if BUILT not in path.as_posix()]
    labels = set().union(*(_labels(path) for path in pages if path.is_relative_to(root / "docs")))
    found = [fault for path in pages for link in links(path) for fault in _fault(path, link, root, labels)]
    listed = {_target(path, link, root) for path in pages for link in links(path) if link.page}
    found += [
        f"{path.relative_to(root)} must stand in a toctree, where readers find it"
        for path in pages
        if path.is_relative_to(root / "docs") and path != root / "docs/index.md" and path not in listed
    ]
    return found


def links(page: Path) -> list[Link]:
    """Every link and picture of a page, and the entries of its tables of contents; nothing that is code."""
    text = page.read_text(encoding="utf-8")
    found = []
    for fence in _FENCE.finditer(text):
        kind = fence["kind"].strip()
        if kind.startswith(("{image}", "{figure}", "{literalinclude}")):
            found.append(Link(kind.partition("}")[2].strip()))
        if kind.startswith("{toctree}"):
            lines = (line.strip() for line in fence["body"].splitlines())
            found += [Link(line, page=True) for line in lines if line and not line.startswith(":")]
    prose = _CODE.sub("", _FENCE.sub("", text))
    found += [Link(match["to"]) for match in _INLINE.finditer(prose)]
    found += [Link(match["to"]) for match in _DEFINED.finditer(prose)]
    return [link for link in found if not _ELSEWHERE.match(link.to)]


def anchors(page: Path, *, deepest: int = 6) -> set[str]:
    """The names by which links find the headings of a page, down to a level, and its labels."""
    text, names = _FENCE.sub("", page.read_text(encoding="utf-8")), _labels(page)
    counted: Counter[str] = Counter()
    for heading in _HEADING.finditer(text):
        name = _slug(heading["title"])
        again = counted[name]
        counted[name] += 1
        if len(heading["level"]) <= deepest:
            names.add(f"{name}-{again}" if again else name)
    return names


def _labels(page: Path) -> set[str]:
    """Names that a page gives to places of its own, by which every page of the documentation finds them."""
    return {match["name"] for match in _LABEL.finditer(_FENCE.sub("", page.read_text(encoding="utf-8")))}


def _pages(root: Path) -> list[Path]:
    return sorted(path for pattern in PAGES for path in root.glob(pattern))


def _target(page: Path, link: Link, root: Path) -> Path:
    name = unquote(link.to.partition("#")[0])
    if not name:
        return page
    base = root if name.startswith("/") else page.parent
    return (base / (name.lstrip("/") + (".md" if link.page else ""))).resolve()


def _fault(page: Path, link: Link, root: Path, labels: set[str]) -> list[str]:
    target, anchor = _target(page, link, root), unquote(link.to.partition("#")[2])
    where = page.relative_to(root)
    if not target.is_relative_to(root.resolve()):
        return [f"{where} must link inside the repository or by an address; got {link.to!r}"]
    if not target.exists():
        return [f"{where} links to {link.to!r}, which does not exist"]
    if not anchor or target.suffix != ".md":
        return []
    documented = page.is_relative_to(root / "docs")
    deepest = DEEPEST if documented else 6
    if anchor in anchors(target, deepest=deepest) or (documented and target == page and anchor in labels):
        return []
    return [f"{where} links to {link.to!r}, where no heading of level 1 to {deepest} is called so"]


def _slug(title: str) -> str:
    """A heading's name as GitHub and MyST make it."""
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).replace("`", "")
    return re.sub(r"[^\w\- ]", "", plain.lower()).strip().replace(" ", "-")
