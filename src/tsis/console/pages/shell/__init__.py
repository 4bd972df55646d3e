"""What is around every page: the way to the others, who holds the camera, what is wrong, and the notice."""

from tsis.console.pages.shell.shell import Shell

__all__ = ["Shell"]
