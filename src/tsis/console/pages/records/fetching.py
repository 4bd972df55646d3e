"""A file that takes a while to be written, fetched by the open page: a sentence where there is none."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from tsis.console.pages.viewer import Viewer

LONGEST_S = 600.0
FETCH = """
    const answer = await fetch(%s);
    if (!answer.ok) return await answer.text();
    const link = document.createElement("a");
    const said = answer.headers.get("content-disposition") || "";
    link.download = (said.match(/filename="([^"]+)"/) || ["", "tsis"])[1];
    link.href = URL.createObjectURL(await answer.blob());
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    return "";
"""
CUT = "the file did not come: the connection was cut or it took too long; try again, or tsis records export"


async def fetch_file(viewer: Viewer, address: str) -> bool:
    """Have the browser fetch a file and keep it; False, after the reason was shown, when there is none."""
    try:
        sentence = await ui.run_javascript(FETCH % json.dumps(address), timeout=LONGEST_S)
    except TimeoutError:
        sentence = CUT
    if sentence:
        viewer.complain(str(sentence))
    return not sentence
