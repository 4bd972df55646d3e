"""The frame of every page: navigation, control of the camera, problems, and the notice."""

from tsis.console.pages.shell._shell import AT_ONCE, LANGUAGE, Shell, set_lost_connection_text

__all__ = ["AT_ONCE", "LANGUAGE", "Shell", "set_lost_connection_text"]
