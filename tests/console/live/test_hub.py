"""Frames, colours and the live WebSocket, read by other means than they were written with."""

from __future__ import annotations

import io
import json
import math
import re
import socket
import threading
from contextlib import contextmanager
from dataclasses import asdict, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI, WebSocket
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from matplotlib import colormaps
from PIL import Image
from tests.console.live.feed import Feed
from tests.waiting import HANGS_S, until
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tsis.console.live.hub import (
    DIFFERENCE,
    GREY,
    MAPS,
    LiveHub,
    analysis_json,
    checked_ends,
    display_levels,
    is_here,
    live_view,
    packed_colours,
    packet,
    still_packet,
)
from tsis.console.services.frames import ContactView, FrameAnalysis
from tsis.errors import InputError, UnknownNameError
from tsis.imaging.colour import colour_map
from tsis.instrument.acquisition import ReceivedFrame
from tsis.instrument.camera import Frame
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray
    from websockets.sync.client import ClientConnection


def arrival(pixels: NDArray[Any], full_scale: float = 255.0) -> ReceivedFrame:
    return ReceivedFrame(frame=Frame(pixels=pixels, sequence=0, full_scale=full_scale), arrived_s=1.0)


def taken_apart(created: bytes) -> tuple[dict[str, Any], bytes]:
    """The header's fields, each cut out by hand."""
    whole = {
        name: int.from_bytes(created[a:b], "little")
        for name, a, b in (("encoding", 4, 5), ("number", 8, 12), ("rows", 12, 14), ("columns", 14, 16))
    }
    real = {"came_ms": np.frombuffer(created[16:24], "<f8")[0], "full_scale": np.frombuffer(created[24:28], "<f4")[0]}
    return {"magic": created[:4], **whole, **real}, created[32:]


@settings(max_examples=30)
@given(
    pixels=arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=40)),
    number=st.integers(0, 2**40),
    came_ms=st.floats(0, 1e14),
)
def test_a_raw_frame_comes_whole(pixels: NDArray[np.uint8], number: int, came_ms: float) -> None:
    head, body = taken_apart(packet(arrival(pixels), number=number, came_ms=came_ms))
    assert head["magic"] == b"TSF1"
    assert (head["encoding"], head["number"]) == (0, number % 2**32)
    assert (head["came_ms"], head["full_scale"]) == (came_ms, 255.0)
    assert body == pixels.tobytes()
    assert (head["rows"], head["columns"]) == pixels.shape


@pytest.mark.parametrize("full_scale", [15, 1023, 4095, 65535])
def test_deep_frames_are_brought_to_what_a_screen_shows(full_scale: int) -> None:
    pixels = np.linspace(0, full_scale, 60 * 50).round().astype(np.uint16).reshape(60, 50)
    head, body = taken_apart(packet(arrival(pixels, full_scale), number=1, came_ms=0.0))
    shown = np.frombuffer(body, np.uint8).reshape(60, 50)
    assert head["full_scale"] == full_scale
    assert np.abs(shown - pixels.astype(float) * 255 / full_scale).max() <= 0.5 + 1e-3
    assert (shown.min(), shown.max()) == (0, 255)


def test_levels_beyond_full_scale_are_shown_as_full() -> None:
    assert display_levels(arrival(np.array([[-3.0, 12.0, 24.0, 90.0]]), 24.0)).tolist() == [[0, 128, 255, 255]]


@pytest.mark.parametrize(("quality", "most"), [(50, 2.5), (85, 1.5), (100, 0.6)])
def test_a_picture_is_what_the_frame_was_but_for_its_quality(quality: int, most: float) -> None:
    x, y = np.meshgrid(np.arange(160.0), np.arange(120.0))
    smooth = 20 + 200 * np.exp(-((x - 90) ** 2 + (y - 50) ** 2) / 800)
    noisy = smooth + np.random.default_rng(3).normal(0, 1, smooth.shape)
    pixels = noisy.round().clip(0, 255).astype(np.uint8)
    head, body = taken_apart(packet(arrival(pixels), number=1, came_ms=0.0, jpeg_quality=quality))
    picture = Image.open(io.BytesIO(body))
    assert head["encoding"] == 1
    assert (picture.mode, picture.size) == ("L", (160, 120))
    error = np.asarray(picture, float) - pixels
    assert np.sqrt(np.mean(error**2)) < most
    assert len(body) < pixels.nbytes


def test_better_pictures_take_more_bytes_and_err_less() -> None:
    pixels = np.random.default_rng(4).integers(0, 255, (64, 64), dtype=np.uint8)
    bodies = [taken_apart(packet(arrival(pixels), number=1, came_ms=0.0, jpeg_quality=q))[1] for q in (1, 50, 100)]
    errors = [float(np.abs(np.asarray(Image.open(io.BytesIO(body)), float) - pixels).mean()) for body in bodies]
    assert sorted(map(len, bodies)) == [*map(len, bodies)]
    assert sorted(errors, reverse=True) == errors


def unpacked(name: str) -> np.ndarray:
    """Bytes as a canvas holds them: red, green, blue, alpha."""
    return np.array(packed_colours(name), dtype="<u4").view(np.uint8).reshape(256, 4)


@pytest.mark.parametrize("name", [item for item in MAPS if item != GREY])
def test_each_level_gets_the_colour_of_the_saved_picture(name: str) -> None:
    whole = colour_map(TactileImage(grey=np.arange(256.0)[None, :]), name=name)[0]
    assert np.array_equal(unpacked(name)[:, :3], whole)
    assert (unpacked(name)[:, 3] == 255).all()


@pytest.mark.parametrize("name", MAPS)
def test_maps_are_those_that_matplotlib_names_so(name: str) -> None:
    theirs = colormaps["gray" if name == GREY else name](np.arange(256), bytes=True)[:, :3].astype(int)
    assert np.abs(unpacked(name)[:, :3] - theirs).max() <= 2


def test_an_unknown_map_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="jet"):
        packed_colours("jet")


def test_signs_are_told_by_blue_and_red_about_white() -> None:
    red, _, blue = unpacked(DIFFERENCE)[:, :3].T.astype(int)
    assert (red[:100] < blue[:100]).all()
    assert (red[156:] > blue[156:]).all()
    assert unpacked(DIFFERENCE)[127:129, :3].min() > 240


@pytest.mark.parametrize(("full_scale", "zero"), [(255.0, 0.0), (4095.0, 0.0), (80.0, -40.0)])
def test_a_single_frame_comes_whole_with_the_level_of_black(full_scale: float, zero: float) -> None:
    grey = np.linspace(zero, zero + full_scale, 60 * 50).reshape(60, 50)
    created = still_packet(TactileImage(grey=grey, full_scale=full_scale), zero=zero)
    head, body = taken_apart(created)
    assert (head["encoding"], head["rows"], head["columns"], head["full_scale"]) == (1, 60, 50, full_scale)
    assert np.frombuffer(created[28:32], "<f4")[0] == zero
    shown = np.asarray(Image.open(io.BytesIO(body)), float)
    assert np.abs(zero + shown / 255 * full_scale - grey).max() <= full_scale / 510 * 1.01


def test_ends_are_two_levels_and_an_exponent() -> None:
    assert checked_ends((10, 200), 0.5) == [10.0, 200.0, 0.5]
    with pytest.raises(InputError, match="gamma"):
        checked_ends((10, 200), 0.0)


@pytest.mark.parametrize("ends", [(10, 10), (200, 10), (-1, 10), (0, 256), (float("nan"), 3), (0, float("inf"))])
def test_ends_that_make_no_map_are_refused(ends: tuple[float, float]) -> None:
    with pytest.raises(InputError, match=re.compile("low|high")):
        checked_ends(ends, 1.0)


ANALYSIS = FrameAnalysis(
    number=1,
    flags=(),
    force=None,
    still="settled",
    contact=ContactView(centroid_px=(3.0, 4.0), outline_px=((1.0, 2.0), (3.0, 4.0))),
    histogram=(5, 6),
    clipped_share=0.25,
    warnings=("too bright",),
)
RNG = np.random.default_rng(8)


class Served:
    """A server of the live view whose frames, camera and sight a test changes."""

    def __init__(self, patience_s: float) -> None:
        self.feed: Feed | None = Feed()
        self.instrument = SimpleNamespace(frame_analysis=None)
        self.hub = LiveHub(lambda: self.feed)  # type: ignore[arg-type, return-value]
        created = FastAPI()

        @created.websocket("/live")
        async def live(requested: WebSocket) -> None:
            await live_view(requested, instrument=self.instrument, hub=self.hub, timeout_s=patience_s)  # type: ignore[arg-type]

        listener = socket.create_server(("127.0.0.1", 0))
        self.port = listener.getsockname()[1]
        self.server = uvicorn.Server(uvicorn.Config(created, log_level="error", ws_per_message_deflate=False))
        self._thread = threading.Thread(target=self.server.run, kwargs={"sockets": [listener]}, daemon=True)
        self._thread.start()

    @property
    def thread_name(self) -> str:
        """Of the thread in which all viewers are served."""
        return self._thread.name

    def bring(self, shape: tuple[int, int] = (12, 16), full_scale: float = 255.0) -> NDArray[Any]:
        """A new frame of noise, which has reached the hub."""
        kind = np.uint8 if full_scale == 255.0 else np.uint16
        pixels = RNG.integers(0, int(full_scale), shape).astype(kind)
        assert self.feed is not None
        arrival = self.feed.bring(pixels, full_scale=full_scale)
        until(lambda: self.hub.latest is not None and self.hub.latest.received is arrival)
        return pixels

    def viewer(self, asks: str = "") -> ClientConnection:
        """A client that has joined."""
        before = self.hub.viewers
        created = connect(f"ws://127.0.0.1:{self.port}/live{asks}", max_size=None)
        until(lambda: self.hub.viewers > before)
        return created

    def end(self) -> None:
        self.server.should_exit = True
        self._thread.join(HANGS_S)
        self.hub.close()


@contextmanager
def serving(patience_s: float = HANGS_S) -> Iterator[Served]:
    served = Served(patience_s)
    try:
        yield served
    finally:
        served.end()


@pytest.fixture
def served() -> Iterator[Served]:
    with serving() as running:
        yield running


def next_frame(viewer: ClientConnection) -> tuple[int, NDArray[np.uint8] | bytes]:
    """Number and pixels of the next frame; words on the way are passed over."""
    message = viewer.recv(HANGS_S)
    while isinstance(message, str):
        message = viewer.recv(HANGS_S)
    rows, columns = int.from_bytes(message[12:14], "little"), int.from_bytes(message[14:16], "little")
    number, body = int.from_bytes(message[8:12], "little"), message[32:]
    return number, body if message[4] else np.frombuffer(body, np.uint8).reshape(rows, columns)


@pytest.mark.system
def test_frames_come_one_by_one_as_they_are_acknowledged(served: Served) -> None:
    with served.viewer() as viewer:
        for number in range(1, 6):
            pixels = served.bring()
            got, shown = next_frame(viewer)
            assert got == number
            assert np.array_equal(shown, pixels)
            viewer.send("ok")


@pytest.mark.system
def test_a_slow_viewer_gets_the_newest_frame_and_none_in_between(served: Served) -> None:
    with served.viewer() as slow, served.viewer() as quick:
        served.bring()
        assert next_frame(slow)[0] == next_frame(quick)[0] == 1
        for number in range(2, 41):
            quick.send("ok")
            newest = served.bring()
            assert next_frame(quick)[0] == number
        with pytest.raises(TimeoutError):  # the quick one got 39 more, and nothing went to the slow one
            slow.recv(timeout=0)
        slow.send("ok")
        number, shown = next_frame(slow)
        assert number == 40
        assert np.array_equal(shown, newest)


@pytest.mark.system
def test_who_joins_late_gets_the_newest_frame_at_once(served: Served) -> None:
    served.bring()
    newest = served.bring()
    with served.viewer() as viewer:
        assert np.array_equal(next_frame(viewer)[1], newest)


@pytest.mark.system
def test_deep_frames_are_shown_in_eight_bits(served: Served) -> None:
    with served.viewer() as viewer:
        pixels = served.bring(full_scale=4095.0)
        shown = next_frame(viewer)[1]
        assert np.abs(np.asarray(shown, float) - pixels * (255 / 4095)).max() <= 0.501


@pytest.mark.system
def test_another_camera_shows_under_an_open_view(served: Served) -> None:
    with served.viewer() as viewer:
        served.bring()
        next_frame(viewer)
        served.feed = Feed()
        until(lambda: served.hub.latest is None)
        viewer.send("ok")
        pixels = served.bring((7, 9), full_scale=1023.0)
        number, shown = next_frame(viewer)
        assert number == 1
        assert np.asarray(shown).shape == pixels.shape


@pytest.mark.system
def test_no_frame_of_a_stopped_camera_is_shown_to_who_comes_later(served: Served) -> None:
    served.bring()
    served.feed = None
    until(lambda: served.hub.latest is None)
    with served.viewer() as viewer, pytest.raises(TimeoutError):
        viewer.recv(timeout=0.2)


@pytest.mark.system
@pytest.mark.parametrize(("asks", "quality"), [("?jpeg=85", 85), ("?jpeg=100", 100), ("?jpeg=999", 100)])
def test_pictures_of_the_quality_that_was_asked_for(served: Served, asks: str, quality: int) -> None:
    with served.viewer(asks) as viewer:
        pixels = served.bring((48, 64))
        body = next_frame(viewer)[1]
        assert isinstance(body, bytes)
        expected = io.BytesIO()
        Image.fromarray(pixels).save(expected, "jpeg", quality=quality)
        ours, theirs = (np.asarray(Image.open(item), float) for item in (io.BytesIO(body), expected))
        assert abs(np.abs(ours - pixels).mean() - np.abs(theirs - pixels).mean()) < 0.25


@pytest.mark.system
@pytest.mark.parametrize("asks", ["", "?jpeg=0", "?jpeg=nonsense", "?jpeg=-3", "?jpeg=12345", "?jpeg=²"])
def test_raw_pixels_on_this_machine_whatever_else_is_asked(served: Served, asks: str) -> None:
    with served.viewer(asks.replace("²", "%C2%B2")) as viewer:
        pixels = served.bring()
        assert np.array_equal(next_frame(viewer)[1], pixels)


@pytest.mark.system
def test_what_is_seen_comes_before_the_frame_once(served: Served) -> None:
    with served.viewer() as viewer:
        served.instrument.frame_analysis = ANALYSIS
        served.bring()
        assert json.loads(viewer.recv(HANGS_S)) == json.loads(json.dumps(asdict(ANALYSIS)))
        assert isinstance(viewer.recv(HANGS_S), bytes)
        viewer.send("ok")
        served.bring()
        assert isinstance(viewer.recv(HANGS_S), bytes)
        served.instrument.frame_analysis = None
        viewer.send("ok")
        served.bring()
        assert viewer.recv(HANGS_S) == "null"


@pytest.mark.system
def test_a_viewer_that_never_acknowledges_is_let_go() -> None:
    with serving(patience_s=0.2) as served, served.viewer() as viewer:
        served.bring()
        next_frame(viewer)
        with pytest.raises(ConnectionClosed) as closed:
            viewer.recv(HANGS_S)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1013
        until(lambda: served.hub.viewers == 0)


@pytest.mark.system
@pytest.mark.parametrize("frames", [0, 1])
def test_who_goes_is_noticed_while_no_frames_come(served: Served, frames: int) -> None:
    with served.viewer() as viewer:
        for _ in range(frames):
            served.bring()
            next_frame(viewer)
    until(lambda: served.hub.viewers == 0)


@pytest.mark.system
def test_anything_that_is_sent_counts_as_an_acknowledgement(served: Served) -> None:
    with served.viewer() as viewer:
        label: tuple[str | bytes, ...] = ("", "no", b"\x00\xff", "x" * 1000)
        for number, word in enumerate(label, start=1):
            served.bring()
            assert next_frame(viewer)[0] == number
            viewer.send(word)


@pytest.mark.system
def test_viewers_are_told_when_the_server_ends() -> None:
    with serving() as served, served.viewer() as viewer:
        served.bring()
        next_frame(viewer)
        served.end()
        with pytest.raises(ConnectionClosed):
            viewer.recv(HANGS_S)
        assert served.hub.viewers == 0


@pytest.mark.system
@pytest.mark.parametrize(
    ("asks", "full_scale", "apart"), [("", 255.0, False), ("", 4095.0, True), ("?jpeg=85", 255.0, True)]
)
def test_a_frame_is_made_once_for_all_and_not_where_all_wait_for_it(
    served: Served, monkeypatch: pytest.MonkeyPatch, asks: str, full_scale: float, apart: bool
) -> None:
    created: list[str] = []
    second = threading.Event()

    def packed(*given: Any, **named: Any) -> bytes:
        created.append(threading.current_thread().name)
        if apart:
            second.wait(0.2 if len(created) == 1 else 0.0)  # in which another one could begin
        return packet(*given, **named)

    monkeypatch.setattr("tsis.console.live.hub.packet", packed)
    with served.viewer(asks) as one, served.viewer(asks) as other:
        served.bring(full_scale=full_scale)
        assert next_frame(one)[0] == next_frame(other)[0] == 1
    assert created == [created[0]]
    assert (created[0] == served.thread_name) is not apart


@pytest.mark.system
def test_words_of_a_frame_are_made_once_for_all(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    created: list[FrameAnalysis | None] = []

    def text(analysis: FrameAnalysis | None) -> str:
        created.append(analysis)
        return analysis_json(analysis)

    monkeypatch.setattr("tsis.console.live.hub.analysis_json", text)
    with served.viewer() as one, served.viewer() as other:
        for analysis in (ANALYSIS, replace(ANALYSIS, number=2)):
            served.instrument.frame_analysis = analysis
            served.bring()
            for viewer in (one, other):
                assert json.loads(viewer.recv(HANGS_S))["number"] == analysis.number
                next_frame(viewer)
                viewer.send("ok")
    assert [item and item.number for item in created] == [1, 2]


def test_what_is_not_finite_is_told_as_unknown() -> None:
    text = analysis_json(
        replace(ANALYSIS, clipped_share=math.nan, contact=ContactView(centroid_px=(math.inf, 1.0), outline_px=()))
    )
    reported = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert (reported["clipped_share"], reported["contact"]["centroid_px"]) == (None, [None, 1.0])


@pytest.mark.parametrize(
    ("host", "here"), [("127.0.0.1", True), ("::1", True), ("192.168.1.4", False), ("testclient", False)]
)
def test_who_is_on_this_machine(host: str, here: bool) -> None:
    assert is_here(SimpleNamespace(client=SimpleNamespace(host=host))) is here  # type: ignore[arg-type]
    assert not is_here(SimpleNamespace(client=None))  # type: ignore[arg-type]
