"""The newest frame as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import cv2
from fastapi import APIRouter, Query, Response

from tsis.console.api.asking import TheBench
from tsis.console.api.documented import picture
from tsis.console.live.packet import display_levels
from tsis.instrument.png import QUICK, whole_levels

if TYPE_CHECKING:
    from tsis.instrument.acquisition import ReceivedFrame

frames_router = APIRouter(tags=["frames"])
Quality = Annotated[int, Query(ge=1, le=100, description="of JPEG")]


@frames_router.get("/frame.png", operation_id="get_frame_png", response_class=Response, responses=picture("image/png"))
def get_frame_png(bench: TheBench) -> Response:
    """Send the newest frame, lossless: grey levels of 8 bits, or 16 where the camera has more.

    It was begun after the last change of a setting or a press. Answers 503 while the camera is stopped or away.
    """
    arrival = bench.desk.fresh()
    levels = whole_levels(arrival.frame.pixels, arrival.frame.full_scale)
    return _sent(arrival, cv2.imencode(".png", levels, QUICK)[1].tobytes(), "image/png")


@frames_router.get("/frame.jpg", operation_id="get_frame_jpg", response_class=Response, responses=picture("image/jpeg"))
def get_frame_jpg(bench: TheBench, quality: Quality = 85) -> Response:
    """Send the newest frame as a small picture of 8 bits, for the eye."""
    arrival = bench.desk.fresh()
    content = cv2.imencode(".jpg", display_levels(arrival), [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
    return _sent(arrival, content, "image/jpeg")


def _sent(arrival: ReceivedFrame, content: bytes, kind: str) -> Response:
    headers = {"TSIS-Frame": str(arrival.frame.sequence), "TSIS-Full-Scale": f"{arrival.frame.full_scale:g}"}
    return Response(content, media_type=kind, headers=headers)
