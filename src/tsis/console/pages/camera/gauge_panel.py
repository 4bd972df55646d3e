"""A force gauge on a serial port beside a real camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.loading import loading
from tsis.console.pages.number_field import typed_number, unit_field
from tsis.instrument.gauge import find_ports
from tsis.instrument.gauge.connecting import BAUD, connected_gauge
from tsis.model.check import require_integer
from tsis.model.errors import GaugeError

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer

ITS_OWN = "as it sends"
UNITS = (ITS_OWN, "N", "mN", "kN", "gf", "kgf", "lbf", "ozf")
FASTEST = 4_000_000


class GaugePanel:
    """Connect a gauge and let go of it; only there for real cameras.

    Parameters
    ----------
    bench, viewer, operated
        As of `ChosenPanel`.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer = bench, viewer
        with ui.element("section").classes("panel stack tight") as self._panel:
            panel_title("Force gauge")
            self._in_use = ui.label().props("role=status")
            with ui.element("div").classes("row"):
                self._port = ui.select([], label="Serial port", with_input=True, new_value_mode="add-unique")
                self._unit = ui.select(list(UNITS), value=ITS_OWN, label="Unit")
                self._baud = unit_field("Bits per second", str(BAUD), keys="numeric")
            self._sends = ui.switch("It sends on its own and is not to be asked")
            with ui.element("div").classes("row"):
                self._connect = ui.button("Connect", on_click=self._begin).props("no-caps outline")
                leave = ui.button("Use no gauge", on_click=self._left).props("no-caps outline")
            for each in (self._port, self._unit, self._baud):
                operated.add(each.props("dense outlined"))
            for control in (self._sends, self._connect, leave):
                operated.add(control)
        self._panel.set_visibility(False)
        ui.timer(0.0, self._ports, once=True)

    def show(self, state: BenchState) -> None:
        """Be there for real cameras, and say what is connected."""
        self._panel.set_visibility(not state.camera.choice.is_virtual)
        self._in_use.text = (
            f"Forces are read from the {state.gauge}." if state.gauge else "Forces are typed, or not known."
        )

    async def _ports(self) -> None:
        try:
            ports = await run.io_bound(find_ports) or ()
        except GaugeError as error:
            self._viewer.complain(str(error))
            return
        self._port.set_options([port.device for port in ports], value=ports[0].device if ports else None)

    async def _begin(self) -> None:
        with loading(self._connect):
            await self._viewer.attempt(self._connected)

    def _connected(self) -> None:
        baud = require_integer(
            "baud", typed_number("baud", str(self._baud.value or "")), 50, FASTEST, hint="bits per second"
        )
        unit = None if self._unit.value == ITS_OWN else str(self._unit.value)
        self._bench.control.require(self._viewer.identity)
        log = connected_gauge(str(self._port.value or ""), unit=unit, baud=baud, sends=bool(self._sends.value))
        try:
            self._bench.use_gauge(log, by=self._viewer.identity)
        except Exception:
            log.stop()
            raise

    async def _left(self) -> None:
        await self._viewer.attempt(self._bench.use_gauge, None, by=self._viewer.identity)
