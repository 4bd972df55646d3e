"""The pages by their addresses, in the order in which the shell names them."""

from __future__ import annotations

import re
from importlib import import_module
from inspect import Parameter, Signature
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["PAGES", "UNLISTED", "load_pages"]
_PAGES = (
    ("/", "Examine", "examine", "examine_page"),
    ("/camera", "Camera", "camera", "camera_page"),
    ("/gel", "Gel sensor", "gel", "GelPage"),
    ("/calibrate", "Calibrate", "calibrate", "calibrate_page"),
    ("/calibrate/{name}", "Calibrate", "calibrate", "session_page"),
    ("/images", "My images", "images", "images_page"),
    ("/hardness", "Hardness", "hardness", "HardnessPage"),
    ("/study", "Study", "study", "study_listing"),
    ("/study/{name}", "Study", "study", "show_study"),
    ("/records", "Records", "records", "target_listing"),
    ("/records/compare/{pair}", "Records", "target", "compare_targets"),
    ("/records/{number}", "Records", "target", "show_target"),
    ("/design", "Design", "design", "design_tab"),
    ("/jobs", "Jobs", "jobs", "jobs_page"),
    ("/about", "About", "about", "about_page"),
)
UNLISTED = ("/jobs",)  # reached by a button of the header


def _page(address: str, module: str, name: str) -> Callable[..., object]:
    """The function or class of a page, whose module is loaded when the page is first opened.

    It is called with the instrument, the viewer, and the parts of its address in braces.
    """

    def build(*given: object, **parts: object) -> object:
        return getattr(import_module(f"{__name__}.{module}"), name)(*given, **parts)

    names = ("instrument", "viewer", *re.findall(r"\{(\w+)\}", address))
    build.__signature__ = Signature([Parameter(item, Parameter.POSITIONAL_OR_KEYWORD) for item in names])  # type: ignore[attr-defined]
    return build


LIBRARIES = ("scipy.interpolate", "scipy.ndimage", "scipy.stats")  # parts that estimates and reports need


def load_pages() -> None:
    """Load the modules of all pages and what their work needs: the first time then is as quick as later ones."""
    for _, _, module, _ in _PAGES:
        import_module(f"{__name__}.{module}")
    for name in LIBRARIES:
        import_module(name)


PAGES: dict[str, tuple[str, Callable[..., object]]] = {
    address: (title, _page(address, module, name)) for address, title, module, name in _PAGES
}
