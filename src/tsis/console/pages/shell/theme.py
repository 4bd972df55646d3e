"""Light, dark, or as the system has it: chosen in the browser and remembered there, nowhere else."""

from __future__ import annotations

from nicegui.element import Element

REMEMBERED = "tsis-colours"  # key in the browser's local storage; theme.js has it too
AT_ONCE = f"""<script>
(() => {{
  let chosen = null;
  try {{ chosen = localStorage.getItem("{REMEMBERED}"); }} catch {{ /* storage is refused: as the system has it */ }}
  const dark = chosen === "dark" || (chosen !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.classList.toggle("dark", dark);
}})();
</script>"""
"""Colours the page before anything is on it, so that a dark room sees no white flash."""


class ThemeChoice(Element, component="theme.js"):
    """A button that goes through light, dark and as the system has it."""
