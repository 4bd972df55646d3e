"""Who takes the camera while somebody else takes it: nobody loses it without having been asked for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from tests.console.pages.open_page import Told, on_a_page

from tsis.console.pages.shell._control import ControlButtons
from tsis.console.services import ControlLock, Owner

if TYPE_CHECKING:
    from collections.abc import Callable


class Faster(ControlLock):
    """Bob takes the camera just after somebody saw that nobody holds it."""

    def owner(self) -> Owner | None:
        found = super().owner()
        if found is None:
            self.take("tab 2", "Bob")
        return found


def after(act: Callable[[ControlButtons], Any]) -> tuple[str, list[str]]:
    """Who holds the camera after something was done on a page, and what was complained of there."""
    bench = SimpleNamespace(control=Faster())
    complaints: list[str] = []

    async def done(viewer: Told) -> None:
        waited = act(ControlButtons(bench, viewer))  # type: ignore[arg-type]
        if waited is not None:
            await waited
        complaints.extend(viewer.complaints)

    on_a_page(bench, done)
    holder = ControlLock.owner(bench.control)
    return "" if holder is None else holder.name, complaints


def test_a_page_that_is_open_takes_it_from_nobody() -> None:
    assert after(ControlButtons.report_open) == ("Bob", [])


def test_a_click_on_a_free_camera_takes_it_from_nobody() -> None:
    assert after(ControlButtons._take_control) == ("Bob", ["the camera is held by Bob; watch, or take it over"])


def test_who_answers_the_question_takes_it_over() -> None:
    async def asked(holding: ControlButtons) -> None:
        await holding._take_control()
        await holding._take_control()
        assert holding._dialog.value
        assert holding._question.text.startswith("Bob holds the camera")
        await holding._take_over()

    assert after(asked)[0] == "Ann"
