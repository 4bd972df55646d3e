"""Files that pages link to: small pictures of frames, reports, exports."""

from tsis.console.files.router import files_router

__all__ = ["files_router"]
