"""Links between pages point at files and headings that exist; addresses of other sites are not asked for."""

from __future__ import annotations

from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from release.links import PAGES, anchors, faults, links

ROOT = Path(__file__).parents[2]
INDEX = "# Title\n\n```{toctree}\n:caption: All\n\nguide/page\n```\n"
PAGE = "# A page\n\n## What `x.y` does, and why\n\n### Deep\n\n## Again\n\n## Again\n\n(mark)=\nText.\n"


def repository(folder: Path, **pages: str) -> Path:
    """A repository of a README, an index and one page; words of a page given by name replace those."""
    texts = {"README.md": "", "docs/index.md": INDEX, "docs/guide/page.md": PAGE, "docs/a picture.png": ""}
    texts |= {name.replace("__", "/") + ".md": text for name, text in pages.items()}
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def test_no_link_of_this_repository_is_broken() -> None:
    assert faults(ROOT) == []


def test_no_link_is_overlooked() -> None:
    """A reader of Markdown that others wrote sees no link that this one does not."""
    seen = 0
    for path in sorted(path for pattern in PAGES for path in ROOT.glob(pattern) if "_build" not in path.parts):
        ours = {link.to for link in links(path)}
        for token in MarkdownIt("commonmark").enable("table").parse(path.read_text(encoding="utf-8")):
            for child in token.children or ():
                to = str(child.attrs.get("href", child.attrs.get("src", "")))
                if to and ":" not in to:
                    assert to in ours, path
                    seen += 1
    assert seen > 100


@pytest.mark.parametrize(
    "text",
    [
        "[a](docs/guide/page.md)",
        "[a](docs/guide/page.md#what-xy-does-and-why) and [b](docs/guide/page.md#deep)",
        "[a](docs/guide/page.md#again-1)",
        "[a](docs/guide/page.md#mark)",
        "[a](docs/guide) ![b](<docs/a%20picture.png>)",
        "[a][1]\n\n[1]: docs/guide/page.md",
        "[a](https://example.org/nowhere#at-all) <mailto:a@example.org>",
        "```console\n$ [a](nowhere.md)\n```\nand `[a](nowhere.md)`",
        "## Here\n\n[a](#here)",
    ],
)
def test_a_good_link_has_no_fault(tmp_path: Path, text: str) -> None:
    assert faults(repository(tmp_path, README=text)) == []


@pytest.mark.parametrize(
    ("pages", "said"),
    [
        ({"README": "[a](docs/guide/pages.md)"}, "README.md links to 'docs/guide/pages.md', which does not exist"),
        ({"README": "![a](docs/b.png)"}, "'docs/b.png', which does not exist"),
        ({"README": "[a](docs/guide/page.md#again-2)"}, "no heading"),
        ({"README": "[a](#nothing)"}, "no heading"),
        ({"README": "[a](../outside.md)"}, "must link inside the repository"),
        ({"README": "[a][1]\n\n[1]: nowhere.md"}, "'nowhere.md', which does not exist"),
        ({"docs__guide__page": "# Page\n\n### Deep\n\n[a](#deep)"}, "no heading of level 1 to 2"),
        ({"docs__guide__page": "# Page\n\n```{image} ../b.png\n:alt: b\n```"}, "'../b.png', which does not exist"),
        ({"docs__index": INDEX.replace("guide/page", "guide/page\nguide/more")}, "'guide/more', which does not exist"),
        ({"docs__guide__lost": "# Lost"}, "docs/guide/lost.md must stand in a toctree"),
    ],
)
def test_a_broken_link_is_told(tmp_path: Path, pages: dict[str, str], said: str) -> None:
    (fault,) = faults(repository(tmp_path, **pages))
    assert said in fault


def test_a_label_is_found_from_every_page_of_the_documentation(tmp_path: Path) -> None:
    pages = {"docs__index": INDEX + "\n[a](#mark)\n", "README": "[a](#mark)"}
    (fault,) = faults(repository(tmp_path, **pages))
    assert "README.md links to '#mark'" in fault


def test_headings_in_code_are_none(tmp_path: Path) -> None:
    page = repository(tmp_path, README="# One\n\n```console\n# two\n```\n") / "README.md"
    assert anchors(page) == {"one"}
