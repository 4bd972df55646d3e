"""Files that pages link to: small pictures of frames, reports, exports."""

from tsis.console.files._router import GREY, Reports, files_router, target_of, thumbnail_png

__all__ = ["GREY", "Reports", "files_router", "target_of", "thumbnail_png"]
