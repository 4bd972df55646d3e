"""The live view: raw frames over a WebSocket of their own, the latest first."""

from tsis.console.live._element import ADDRESS, Histogram, LiveView, SurfaceView
from tsis.console.live._hub import LiveHub, display_levels, live_view

__all__ = ["ADDRESS", "Histogram", "LiveHub", "LiveView", "SurfaceView", "display_levels", "live_view"]
