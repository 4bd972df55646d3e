"""The live view: raw frames over a WebSocket of their own, the latest first."""

from tsis.console.live._element import ADDRESS, Histogram, LiveView, SurfaceView
from tsis.console.live._hub import FIRST_MAP, LiveHub, display_levels, live_view, packed_colours

__all__ = [
    "ADDRESS",
    "FIRST_MAP",
    "Histogram",
    "LiveHub",
    "LiveView",
    "SurfaceView",
    "display_levels",
    "live_view",
    "packed_colours",
]
