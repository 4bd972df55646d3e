import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY, __version__

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from release import reference_pages, traceability  # noqa: E402
from studies import gallery  # noqa: E402

if TYPE_CHECKING:
    from sphinx.application import Sphinx

project = "tsis"
author = "the TSIS founders"
copyright = "2026, the TSIS founders"
release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "release.mathematics"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 2

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_theme_options = {"announcement": RESEARCH_USE_ONLY}
html_math_renderer = "mathtext"
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_title = f"tsis {release}"


def add_requirements(app: "Sphinx", docname: str, source: list[str]) -> None:
    if docname == "reference/requirements":
        app.env.note_dependency(str(ROOT / traceability.LIST))
        source[0] += "\n" + traceability.page(traceability.read(ROOT), ROOT)


def add_figures(app: "Sphinx", docname: str, source: list[str]) -> None:
    if docname == "figures":
        for path in gallery.sources():
            app.env.note_dependency(str(path))
        source[0] += "\n" + gallery.page(ROOT)


def add_reference(app: "Sphinx", docname: str, source: list[str]) -> None:
    """The commands, the calls, the flags and the programming interface, as the code has them now."""
    if docname == "reference/cli":
        source[0] = source[0].replace("(all commands)", reference_pages.commands())
    elif docname == "reference/http":
        source[0] = source[0].replace("(all calls)", reference_pages.calls())
    elif docname == "reference/flags":
        source[0] = reference_pages.with_flags(source[0])
    elif docname == "reference/api":
        source[0] += "\n" + reference_pages.interface()


def join_names(app: "Sphinx", what: str, name: str, described: object, options: object, lines: list[str]) -> None:
    """Attributes that share a line stay together: after a space the first would be taken for the type of the second."""
    lines[:] = [re.sub("^:ivar [^:]+:", lambda names: names[0].replace(", ", ","), line) for line in lines]


def keep_colons(app: "Sphinx", what: str, name: str, described: object, options: object, lines: list[str]) -> None:
    """A colon in the comment of an attribute is text: napoleon would take what stands before it for a type."""
    if what == "attribute" and lines:
        lines[0] = lines[0].replace(": ", " – ")


def setup(app: "Sphinx") -> None:
    app.connect("autodoc-process-docstring", keep_colons, priority=100)  # before napoleon reads them
    app.connect("autodoc-process-docstring", join_names, priority=900)  # after the fields were made
    app.connect("source-read", add_requirements)
    app.connect("source-read", add_figures)
    app.connect("source-read", add_reference)
