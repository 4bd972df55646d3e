"""How the camera is, as one value."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.console.bench.state import CameraState

if TYPE_CHECKING:
    from tsis.console.bench.desk import CameraDesk


def camera_state(desk: CameraDesk, mm_per_pixel: tuple[float, float] | None) -> CameraState:
    """How the camera on a desk is; it never waits for the camera.

    Parameters
    ----------
    desk
        Where it is.
    mm_per_pixel
        Size (x, y) of a pixel on the face; None when nobody knows it.
    """
    # Asked once: it may be stopped, or be another one, the moment after.
    acquisition, choice = desk.acquisition, desk.choice
    if acquisition is None:
        return CameraState(choice=choice, mm_per_pixel=mm_per_pixel)
    account, latest, mode, failure = acquisition.account(), acquisition.latest(), acquisition.mode, acquisition.failure
    rows, columns = (0, 0) if latest is None else latest.frame.pixels.shape[:2]
    return CameraState(
        choice=choice,
        name=acquisition.name,
        mode="" if mode is None else mode.label,
        modes=tuple(each.label for each in acquisition.modes),
        running=True,
        lost=acquisition.lost or acquisition.ended,
        failure="" if failure is None else str(failure),
        received=account.received,
        missed=account.missed,
        interruptions=len(account.interruptions),
        frames_per_s=account.frames_per_s,
        rows=rows,
        columns=columns,
        full_scale=0.0 if latest is None else latest.frame.full_scale,
        mm_per_pixel=mm_per_pixel,
        settings=desk.settings(),
    )
