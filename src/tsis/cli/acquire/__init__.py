"""``tsis acquire``: frames from any camera onto the disk."""

from tsis.cli.acquire._command import VIRTUAL, acquire, live_connector, requested_settings

__all__ = ["VIRTUAL", "acquire", "live_connector", "requested_settings"]
