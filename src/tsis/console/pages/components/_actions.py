"""Buttons and controls of commands, and the progress of jobs."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

from nicegui import ui

from tsis.console.services import estimate_title

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nicegui.elements.mixins.disableable_element import DisableableElement

    from tsis.console.pages.components._viewer import Viewer
    from tsis.console.services import CameraState, Instrument, InstrumentState, JobState


@contextmanager
def loading(button: ui.button) -> Iterator[None]:
    """Show a button as busy until the block ends."""
    button.props(add="loading")
    try:
        yield
    finally:
        button.props(remove="loading")


STALE_STATES = 2  # states that may still be from before


class UndoMemory:
    """Remembers the value that was replaced.

    Examples
    --------
    >>> last = UndoMemory()
    >>> last.replaced(1)
    >>> last.is_old(1), last.is_old(1), last.is_old(1)
    (True, True, False)
    >>> last.replaced(1)
    >>> last.is_old(2), last.is_old(1)
    (False, False)
    """

    def __init__(self) -> None:
        self._before: object = None
        self._left = 0

    def replaced(self, before: object) -> None:
        """Take note that this value was replaced now."""
        self._before, self._left = before, STALE_STATES

    def is_old(self, value: object) -> bool:
        """Whether a state with this value is probably from before; at most `STALE_STATES` times in a row."""
        if self._left and value == self._before:
            self._left -= 1
            return True
        self._left = 0
        return False


Control = TypeVar("Control", bound="DisableableElement")


class OperatorControls:
    """The controls of one page, enabled for the camera's owner."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._controls: list[DisableableElement] = []
        self._shown = False  # before the first state the controls do not show the instrument's

    def add(self, control: Control, *others: DisableableElement) -> Control:
        """Disable controls for everybody but the owner; returns the first."""
        controls: tuple[DisableableElement, ...] = (control, *others)
        self._controls += controls
        for item in controls:
            item.set_enabled(self._shown and self._viewer.commands)
        return control

    def why(self) -> None:
        """Place the message why controls are disabled."""
        self._message = ui.label().classes("muted watching").props("role=status")

    def show(self, _: InstrumentState) -> None:
        """Enable the controls for the camera's owner."""
        commands, self._shown = self._viewer.commands, True
        self._controls = [control for control in self._controls if not control.is_deleted]
        for control in self._controls:
            control.set_enabled(commands)
        self._message.set_visibility(not commands)
        self._message.text = "You are watching. Take the camera (top of the page) to use the disabled controls."


class ProgressBar:
    """Progress bar of a running job, with a label for screen readers."""

    def __init__(self, label: str) -> None:
        self._bar = ui.linear_progress(0.0, show_value=False, size="6px").props("instant-feedback")
        self._bar.props["aria-label"] = label

    def show(self, job: JobState | None) -> None:
        """Show the progress of the job; None without one."""
        self._bar.set_visibility(job is not None and job.running)
        if job is not None and job.running:
            self._bar.value = job.fraction
            self._bar.props(remove="indeterminate") if job.fraction else self._bar.props(add="indeterminate")


def set_filled(button: ui.button, filled: bool) -> None:
    """Fill the button of the next step; others have an outline."""
    button.props(add="unelevated", remove="outline") if filled else button.props(add="outline", remove="unelevated")


class RunButton:
    """Start or Stop of the camera."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._runs: bool | None = None  # as the button says; None before anything is known
        self.element = ui.button("Start", on_click=self._clicked).props("outline").classes("run")

    def show(self, camera: CameraState, *, main: bool = True) -> None:
        """Say what a click would do; filled when starting is the ``main`` thing to do."""
        self._runs = camera.running
        self.element.text = "Stop" if self._runs else "Start"
        self.element.set_icon("stop" if self._runs else "play_arrow")
        set_filled(self.element, main and not self._runs)

    async def _clicked(self) -> None:
        if self._runs is None:
            return
        with loading(self.element):  # a second click on Start starts nothing more
            await self._viewer.command(self._instrument.stop if self._runs else self._instrument.start)()


def estimate_job(state: InstrumentState) -> JobState | None:
    """The newest estimate of the present target, under way or over; None when there was none."""
    title = estimate_title(state.target)
    return next((job for job in reversed(state.jobs) if job.title == title), None)
