"""The pages by their addresses."""

from __future__ import annotations

import re
from importlib import import_module
from inspect import Parameter, Signature
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

MEASURE, CALIBRATE, RECORDS, TOOLS = "Measure", "Calibrate", "Records", "Tools"
_PAGES = (
    (MEASURE, "/", "Examine", "examine", "examine_page"),
    (MEASURE, "/map", "Map", "map", "map_page"),
    (MEASURE, "/hardness", "Hardness", "hardness", "HardnessPage"),
    (MEASURE, "/gel", "Gel sensor", "gel", "GelPage"),
    (MEASURE, "/images", "My images", "images", "images_page"),
    (CALIBRATE, "/calibrate", "Calibrate", "calibrate", "calibrate_page"),
    (CALIBRATE, "/calibrate/{name}", "Calibrate", "calibrate", "session_page"),
    (RECORDS, "/records", "Targets", "records", "target_listing"),
    (RECORDS, "/records/compare/{pair}", "Targets", "target", "compare_targets"),
    (RECORDS, "/records/{number}", "Targets", "target", "show_target"),
    (RECORDS, "/study", "Studies", "study", "study_listing"),
    (RECORDS, "/study/{name}", "Studies", "study", "show_study"),
    (TOOLS, "/camera", "Camera", "camera", "camera_page"),
    (TOOLS, "/design", "Design", "design", "design_tab"),
    (TOOLS, "/jobs", "Jobs", "jobs", "jobs_page"),
    (TOOLS, "/about", "About", "about", "about_page"),
)


def _page(address: str, module: str, name: str) -> Callable[..., object]:
    """The function or class of a page, whose module is loaded when the page is first opened.

    It is called with the instrument, the viewer, and the parts of its address in braces.
    """

    def build(*given: object, **parts: object) -> object:
        return getattr(import_module(f"{__name__}.{module}"), name)(*given, **parts)

    names = ("instrument", "viewer", *re.findall(r"\{(\w+)\}", address))
    # `ui.sub_pages` of NiceGUI gives a page the parts of its address that its signature names.
    build.__signature__ = Signature([Parameter(item, Parameter.POSITIONAL_OR_KEYWORD) for item in names])  # type: ignore[attr-defined]
    return build


PRELOADED = ("scipy.interpolate", "scipy.ndimage", "scipy.stats")  # parts that estimates and reports need


def load_pages() -> None:
    """Load the modules of all pages and what their work needs, so that the first visit to a page is fast."""
    for _, _, _, module, _ in _PAGES:
        import_module(f"{__name__}.{module}")
    for name in PRELOADED:
        import_module(name)


PAGES: dict[str, tuple[str, Callable[..., object]]] = {
    address: (title, _page(address, module, name)) for _, address, title, module, name in _PAGES
}
GROUPS: dict[str, tuple[str, ...]] = {
    group: tuple(address for page_group, address, *_ in _PAGES if page_group == group and "{" not in address)
    for group in (MEASURE, CALIBRATE, RECORDS, TOOLS)
}
