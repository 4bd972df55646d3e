"""What a page of the console has drawn, asked of its elements."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from playwright.sync_api import Page

EVERY_S = 1.5  # the elements remember the last 120 drawings
ASK = """() => ["figure.live", "figure.surface"].map((name) => {
  const figure = document.querySelector(name);
  return figure ? getElement(figure).measured() : [];
})"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What was drawn.

    Attributes
    ----------
    frames_per_s
        Frames of the live image drawn a second.
    age_p50_ms, age_p95_ms
        From a frame's arrival at the server until it was drawn.
    surface_per_s
        Reliefs drawn a second; 0 without one.
    """

    frames_per_s: float
    age_p50_ms: float
    age_p95_ms: float
    surface_per_s: float


def shown_in(page: Page, seconds: float) -> Shown:
    """Watch what the page draws, for so many seconds from now."""
    frames: dict[float, float] = {}
    surfaces: set[float] = set()
    begun = page.evaluate("performance.now()")
    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        page.wait_for_timeout(1000 * min(EVERY_S, max(0.0, ends - time.monotonic())))
        live, surface = page.evaluate(ASK)
        frames |= {at: age for at, age in live if at >= begun}
        surfaces |= {at for at in surface if at >= begun}
    passed_s = (page.evaluate("performance.now()") - begun) / 1000.0
    ages = np.array(list(frames.values()) or [np.nan])
    return Shown(
        frames_per_s=len(frames) / passed_s,
        age_p50_ms=float(np.percentile(ages, 50)),
        age_p95_ms=float(np.percentile(ages, 95)),
        surface_per_s=len(surfaces) / passed_s,
    )
