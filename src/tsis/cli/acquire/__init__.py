"""``tsis acquire``: frames from any camera onto the disk."""

from tsis.cli.acquire.command import acquire

__all__ = ["acquire"]
