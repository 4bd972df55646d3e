"""The pages by their addresses, in the order in which the shell names them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.console.pages import (
    about,
    calibrate,
    camera,
    design,
    examine,
    gel,
    hardness,
    images,
    jobs,
    records,
    study,
    sweeps,
)

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["PAGES", "UNLISTED"]
UNLISTED = ("/jobs",)  # reached by a button of the header
# A page is called with the instrument, the viewer, and the parts of its address in braces.
PAGES: dict[str, tuple[str, Callable[..., object]]] = {
    "/": ("Examine", examine.examine_page),
    "/camera": ("Camera", camera.camera_page),
    "/gel": ("Gel sensor", gel.GelPage),
    "/calibrate": ("Calibrate", calibrate.calibrate_page),
    "/calibrate/{name}": ("Calibrate", calibrate.session_page),
    "/images": ("My images", images.images_page),
    "/hardness": ("Hardness", hardness.HardnessPage),
    "/study": ("Study", study.study_listing),
    "/study/{name}": ("Study", study.show_study),
    "/records": ("Records", records.target_listing),
    "/records/compare/{pair}": ("Records", records.compare_targets),
    "/records/{number}": ("Records", records.show_target),
    "/design": ("Design", design.design_tab),
    "/sweeps": ("Sweeps", sweeps.SweepsPage),
    "/jobs": ("Jobs", jobs.jobs_page),
    "/about": ("About", about.about_page),
}
