"""Another camera in place of the present one: chosen and started in one act."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tsis.console.bench import Bench, CameraChoice


def choose_and_start(bench: Bench, choice: CameraChoice, *, by: str) -> None:
    """Take another camera and start it; when it does not start it stays chosen, and the error says why.

    Raises
    ------
    ControlError
        When somebody else holds the camera, or a sequence is being recorded.
    TsisError
        When it does not start.
    """
    bench.choose(choice, by=by)
    bench.start(by=by)
