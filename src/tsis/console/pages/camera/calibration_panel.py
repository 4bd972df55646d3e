"""The calibration in force: a file of this person's, the virtual probe's own, or none."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.calibration.cited import parse_usable_calibration
from tsis.calibration.file.content import LARGEST_BYTES
from tsis.console.pages.calibration_seen import CalibrationSeen
from tsis.console.pages.headings import panel_title
from tsis.console.pages.upload import one_file
from tsis.console.pages.words import time_words

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.calibration.cited import UsableCalibration
    from tsis.console.bench import Bench, BenchState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer

SHORT = 12


class CalibrationPanel:
    """Show and change the calibration in force.

    Parameters
    ----------
    bench, viewer, operated
        As of `ChosenPanel`.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer, self._calibration = bench, viewer, CalibrationSeen(bench)
        with ui.element("section").classes("panel stack tight"):
            panel_title("Calibration in force")
            self._name = ui.label()
            self._identity = ui.label().classes("muted wordy")
            refused = f"a calibration file must end in .json and hold at most {LARGEST_BYTES // 2**20} MiB"
            self._upload = one_file(
                viewer, "Calibration file", accept=".json", refused=refused, most_bytes=LARGEST_BYTES
            )
            self._upload.on_upload(self._given)
            self._none = ui.button("Use none", on_click=self._forgotten).props("no-caps outline")
            operated.add(self._upload)
            operated.add(self._none)

    def show(self, state: BenchState) -> None:
        """Show which it is."""
        own = state.camera.choice.is_virtual
        self._name.text = state.calibration or ("the virtual probe's own, once it runs" if own else "none")
        known = self._calibration.of(state)
        self._identity.text = "" if known is None and own else calibration_words(known)
        self._none.text = "Use the virtual probe's own" if own else "Use none"

    async def _given(self, event: UploadEventArguments) -> None:
        content = await event.file.read()
        self._upload.reset()
        done = await self._viewer.attempt(self._used, content, event.file.name)
        if done is not None:
            self._viewer.tell(f"The calibration {done} is in force.")

    def _used(self, content: bytes, name: str) -> str:
        known = parse_usable_calibration(content, name)
        self._bench.use_calibration(known, by=self._viewer.identity)
        return known.known.name

    async def _forgotten(self) -> None:
        await self._viewer.attempt(self._bench.use_calibration, None, by=self._viewer.identity)


def calibration_words(known: UsableCalibration | None) -> str:
    """Its identity and dates."""
    if known is None:
        return "Without one presses are kept, but nothing can be estimated from them."
    made, expires = known.known.made, known.known.expires
    when = "" if made is None else f", made {time_words(made)}"
    until = "" if expires is None else f", expires {time_words(expires)}"
    left = "" if expires is None else f" ({max(0, (expires - datetime.now(UTC)).days)} days left)"
    return f"{known.identity[:SHORT]}{when}{until}{left}"
