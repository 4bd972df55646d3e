"""What the parts of a study's page ask of the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from tsis.console.bench.jobs import Jobs
    from tsis.console.pages.viewer import Viewer
    from tsis.console.studies import StudyShelf


class StudyContext(Protocol):
    """The open page of a study, as its parts see it.

    Attributes
    ----------
    jobs, viewer, shelf
        What runs, the browser tab, and the folder of studies.
    name
        As it stands in the address, whatever that is.
    """

    jobs: Jobs
    viewer: Viewer
    shelf: StudyShelf
    name: str
