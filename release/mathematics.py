"""Formulas of the pages as SVG, drawn by Matplotlib: no script from elsewhere, and the colour of the text around."""

from __future__ import annotations

import html
import io
import re
from functools import cache
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SIZE_PT = 12.0  # that of the text around
# what the pages write and Matplotlib calls otherwise
OTHERWISE = {
    r"\tfrac": r"\frac",
    r"\!": "",
    r"\lvert": "|",
    r"\rvert": "|",
    r"\ ": r"\;",
    r"\ge ": r"\geq ",
    r"\le ": r"\leq ",
}


@cache
def svg(formula: str, size_pt: float = SIZE_PT) -> str:
    """One formula in TeX as an SVG element whose baseline is that of the text around it."""
    text = " ".join(formula.split())
    for ours, theirs in OTHERWISE.items():
        text = text.replace(ours, theirs)
    drawn = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": "tsis", "mathtext.fontset": "dejavusans"}):
        depth = math_to_image(f"${text}$", drawn, prop=FontProperties(size=size_pt), format="svg", color="#010203")
    element = drawn.getvalue()
    element = element[element.index("<svg") :].replace("#010203", "currentColor").strip()
    for part in (
        r"<defs>\s*<style.*?</style>\s*</defs>",
        r"<!--.*?-->",
        r"<metadata>.*?</metadata>",
        r'<g id="patch_1">.*?</g>',
    ):
        element = re.sub(
            part, "", element, count=1, flags=re.DOTALL
        )  # styles of the whole page, time, white background
    element = re.sub(r' id="(figure|text)_1"', "", element)
    return element.replace("<svg ", f'<svg style="vertical-align: {-depth:.2f}pt" aria-hidden="true" ', 1)


def _inline(translator: Any, node: Any) -> None:
    _write(translator, node, "span", SIZE_PT)


def _block(translator: Any, node: Any) -> None:
    _write(translator, node, "div", 1.2 * SIZE_PT)


def _write(translator: Any, node: Any, tag: str, size_pt: float) -> None:
    from docutils import nodes  # installed with Sphinx only

    formula = node.astext()
    said = html.escape(" ".join(formula.split()), quote=True)
    translator.body.append(f'<{tag} class="math" role="img" aria-label="{said}">{svg(formula, size_pt)}</{tag}>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Make this the renderer of formulas, as an extension of Sphinx."""
    app.add_html_math_renderer("mathtext", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
