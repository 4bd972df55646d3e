"""What is around every page: the way to the others, who holds the camera, what is wrong, and the notice."""

from tsis.console.pages.shell._shell import AT_ONCE, LANGUAGE, Shell, set_lost_connection_text

__all__ = ["AT_ONCE", "LANGUAGE", "Shell", "set_lost_connection_text"]
