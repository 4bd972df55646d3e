from __future__ import annotations

from dataclasses import replace

import pytest
from tests.instrument.sources.genicam_stand_ins import FakeNodes

from tsis.errors import CameraError, InputError
from tsis.instrument.camera import Mode
from tsis.instrument.drivers.genicam import apply_mode, modes

NOW = Mode(width_px=512, height_px=384, frames_per_s=30.0, pixel_format="Mono8")


def test_grey_formats_at_the_present_and_at_the_full_size() -> None:
    assert modes(FakeNodes()) == (
        NOW,
        replace(NOW, full_scale=4095.0, pixel_format="Mono12"),
        replace(NOW, width_px=1024, height_px=768, frames_per_s=None),
        replace(NOW, width_px=1024, height_px=768, frames_per_s=None, full_scale=4095.0, pixel_format="Mono12"),
    )


def test_the_present_format_comes_first_and_the_full_size_once() -> None:
    nodes = FakeNodes(PixelFormat="Mono12", OffsetX=0, Width=1024, Height=768)
    assert [mode.label for mode in modes(nodes)] == ["Mono12-1024x768@30", "Mono8-1024x768@30"]


def test_a_mode_that_was_listed_changes_what_it_must_and_nothing_else() -> None:
    nodes = FakeNodes()
    apply_mode(nodes, modes(nodes)[1])
    assert nodes.writes == ["PixelFormat"]
    assert nodes.values["PixelFormat"] == "Mono12"


def test_the_full_size_makes_room_first() -> None:
    nodes = FakeNodes()
    apply_mode(nodes, modes(nodes)[2])
    assert [nodes.values[name] for name in ("Width", "Height", "OffsetX", "OffsetY")] == [1024, 768, 0, 0]


def test_a_size_of_ones_own_becomes_a_region_in_the_middle() -> None:
    nodes = FakeNodes()
    apply_mode(nodes, Mode(width_px=768, height_px=492, pixel_format="Mono8", frames_per_s=50.0))
    assert [nodes.values[name] for name in ("Width", "Height", "OffsetX", "OffsetY")] == [768, 492, 128, 138]
    assert nodes.values["AcquisitionFrameRate"] == 50.0


@pytest.mark.parametrize(
    ("mode", "sentence"),
    [
        (replace(NOW, pixel_format="Mono12Packed"), "no mode Mono12Packed-512x384@30 of full scale 255"),
        (replace(NOW, full_scale=4095.0), r"it offers Mono8 \(full scale 255\), Mono12 \(full scale 4095\)"),
        (Mode(width_px=512, height_px=384), "no mode 512x384 of full scale 255"),
        (replace(NOW, width_px=770), "no mode Mono8-770x384@30; its Width goes from 16 to 1024 by 16"),
        (replace(NOW, height_px=900), "its Height goes from 2 to 768 by 2"),
    ],
)
def test_modes_that_the_camera_has_not_are_named_with_those_it_has(mode: Mode, sentence: str) -> None:
    with pytest.raises(CameraError, match=sentence):
        apply_mode(FakeNodes(), mode)


def test_a_rate_out_of_range_is_named() -> None:
    with pytest.raises(InputError, match=r"frames_per_s must lie in \[1, 60\]; got 500"):
        apply_mode(FakeNodes(), replace(NOW, frames_per_s=500.0))


def test_a_camera_of_colours_only_or_without_a_size_is_refused() -> None:
    nodes = FakeNodes()
    nodes.options["PixelFormat"] = ("RGB8", "BayerRG8")
    with pytest.raises(CameraError, match=r"must offer a grey pixel format .*; it offers RGB8, BayerRG8"):
        modes(nodes)
    nodes = FakeNodes()
    del nodes.values["Height"]
    with pytest.raises(CameraError, match="does not report the size"):
        modes(nodes)
