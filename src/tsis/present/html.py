"""A page as one HTML file without scripts."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined, Template, select_autoescape

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.present.page import address

if TYPE_CHECKING:
    from tsis.present.page import Page


def html_bytes(page: Page) -> bytes:
    """The page as UTF-8."""
    return (
        _template()
        .render(page=page, notice=RESEARCH_USE_ONLY, version=__version__, address=address)
        .encode(errors="backslashreplace")
    )


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("tsis.present"),
        autoescape=select_autoescape(default=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html")
