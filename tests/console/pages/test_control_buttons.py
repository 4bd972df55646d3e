"""Who takes the camera while somebody else takes it: nobody loses it without having been asked for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from tests.console.pages.open_page import RecordingViewer, on_a_page

from tsis.console.pages.shell import ControlButtons
from tsis.console.services.control import ControlLock, Owner

if TYPE_CHECKING:
    from collections.abc import Callable


class Faster(ControlLock):
    """Bob takes the camera just after somebody saw that nobody holds it."""

    def owner(self) -> Owner | None:
        result = super().owner()
        if result is None:
            self.take("tab 2", "Bob")
        return result


def after(command: Callable[[ControlButtons], Any]) -> tuple[str, list[str]]:
    """Who holds the camera after something was done on a page, and what was complained of there."""
    instrument = SimpleNamespace(control=Faster())
    complaints: list[str] = []

    async def done(viewer: RecordingViewer) -> None:
        waited = command(ControlButtons(instrument, viewer))  # type: ignore[arg-type]
        if waited is not None:
            await waited
        complaints.extend(viewer.complaints)

    on_a_page(instrument, done)
    holder = ControlLock.owner(instrument.control)
    return "" if holder is None else holder.name, complaints


def test_a_page_that_is_open_takes_it_from_nobody() -> None:
    assert after(ControlButtons.report_open) == ("Bob", [])


def test_a_click_on_a_free_camera_takes_it_from_nobody() -> None:
    assert after(ControlButtons._take_control) == ("Bob", ["The camera is controlled by Bob; watch, or take it over."])


def test_who_answers_the_question_takes_it_over() -> None:
    async def requested(buttons: ControlButtons) -> None:
        await buttons._take_control()
        await buttons._take_control()
        assert buttons._dialog.value
        assert buttons._question.text.startswith("Bob is using the camera")
        await buttons._take_over()

    assert after(requested)[0] == "Ann"
