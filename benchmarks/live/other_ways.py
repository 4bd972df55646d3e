"""Other ways to show frames in a page, as programs: one way a process.

    python -m benchmarks.live.other_ways mjpeg|interactive_image|three

``mjpeg`` is a picture of type multipart/x-mixed-replace, ``interactive_image`` is NiceGUI's own example of a webcam: a
timer that changes a picture's address. Both show the frames of the console's virtual probe as JPEG of quality 85, the
way that OpenCV's examples make them. ``three`` is a page that has loaded three.js as NiceGUI brings it. The address is
printed first; ``/sent`` answers how many frames were sent.
"""

from __future__ import annotations

import asyncio
import socket
import sys
import time
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

import cv2
import uvicorn
from fastapi import FastAPI, Response
from fastapi.responses import HTMLResponse, StreamingResponse
from nicegui import ui

from tsis.console.services.choice import CameraChoice, VirtualSubject
from tsis.instrument.acquisition import Acquisition

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

QUALITY = 85
BOUNDARY = b"--frame\r\nContent-Type: image/jpeg\r\n\r\n"


class Sender:
    """The newest frame as JPEG, and how many were sent."""

    def __init__(self) -> None:
        self.acquisition = Acquisition(VirtualSubject(CameraChoice()).connect)
        self.sent = 0

    def newest(self) -> bytes:
        """The newest frame."""
        arrival = self.acquisition.latest()
        if arrival is None:
            return b""
        self.sent += 1
        return cv2.imencode(".jpg", arrival.frame.pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()

    async def parts(self) -> AsyncIterator[bytes]:
        """Every new frame as a part of a picture without end."""
        place = 0
        while True:
            ring = self.acquisition.ring
            if await asyncio.to_thread(ring.wait, place, 1.0):
                place = ring.end
                yield BOUNDARY + self.newest() + b"\r\n"


def application(way: str) -> FastAPI:
    """A page that shows the frames in that way."""
    sender = Sender()

    @asynccontextmanager
    async def living(_: FastAPI) -> AsyncIterator[None]:
        sender.acquisition.start()
        yield
        sender.acquisition.stop()

    made = FastAPI(lifespan=living)
    made.get("/sent")(lambda: sender.sent)
    made.get("/frame")(lambda: Response(sender.newest(), media_type="image/jpeg"))
    made.get("/stream")(
        lambda: StreamingResponse(sender.parts(), media_type="multipart/x-mixed-replace; boundary=frame")
    )
    if way == "mjpeg":
        made.get("/")(lambda: HTMLResponse('<img src="/stream" style="width: 760px">'))
        return made

    def page() -> None:
        if way == "three":
            ui.scene(width=100, height=100)
            return
        image = ui.interactive_image("/frame").style("width: 760px")
        ui.timer(1 / 30, lambda: image.set_source(f"/frame?{time.time()}"))

    ui.run_with(made, root=page, show_welcome_message=False)
    return made


def main() -> None:
    """Serve until ended."""
    listener = socket.create_server(("127.0.0.1", 0))
    print(f"http://127.0.0.1:{listener.getsockname()[1]}/", flush=True)
    config = uvicorn.Config(application(sys.argv[1]), log_level="error", ws_per_message_deflate=False)
    uvicorn.Server(config).run(sockets=[listener])


if __name__ == "__main__":
    main()
