"""What of the served camera needs no network: how frames are laid out, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.errors import CameraError, InputError, MissingExtraError
from tsis.model.calibration import LightMap
from tsis.virtual.camera import VirtualCamera
from tsis.virtual.gige import GigEServer, region_bytes, require_free_address
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from numpy.typing import NDArray

MONO_8, MONO_16, RGB_8 = 0x01080001, 0x01100007, 0x02180014


@pytest.fixture(scope="module")
def camera() -> VirtualCamera:
    rng = np.random.default_rng(0)
    rig = VirtualProbe(load_probe("tsis-2011"), rng=rng, light=LightMap.uniform(), strain="small")
    return VirtualCamera(rig, load_phantom("plain"), rng=rng)


@given(
    size=st.tuples(st.integers(1, 6), st.integers(1, 6)),
    first=st.tuples(st.integers(0, 7), st.integers(0, 7)),
    asked=st.tuples(st.integers(1, 8), st.integers(1, 8)),
    seed=st.integers(0, 1000),
)
def test_a_region_is_laid_out_row_by_row(
    size: tuple[int, int], first: tuple[int, int], asked: tuple[int, int], seed: int
) -> None:
    pixels: NDArray[Any] = np.random.default_rng(seed).integers(0, 256, size).astype(np.uint8)
    region = slice(first[0], first[0] + asked[0]), slice(first[1], first[1] + asked[1])
    expected = bytearray()
    for row in range(*region[0].indices(100)):
        for column in range(*region[1].indices(100)):
            expected.append(pixels[row, column] if row < size[0] and column < size[1] else 0)
    assert region_bytes(pixels, region, MONO_8) == bytes(expected)
    deep = np.frombuffer(region_bytes(pixels, region, MONO_16), dtype="<u2")
    np.testing.assert_array_equal(deep, np.frombuffer(bytes(expected), dtype=np.uint8).astype(int) * 65535 // 255)
    coloured = region_bytes(pixels, region, RGB_8)
    assert all(coloured[channel::3] == bytes(expected) for channel in range(3))


@pytest.mark.parametrize("serial", ["", "0123456789abcdef", "with space", "line\nbreak", "../up"])
def test_a_serial_number_that_the_protocol_cannot_carry_is_refused(camera: VirtualCamera, serial: str) -> None:
    with pytest.raises(InputError, match="serial must be 1 to 15"):
        GigEServer(camera, serial=serial)


@pytest.mark.system
def test_what_cannot_be_served_is_refused(camera: VirtualCamera) -> None:
    with pytest.raises(InputError, match="frames_per_s must lie in"):
        GigEServer(camera, frames_per_s=0.0)
    with pytest.raises(InputError, match="camera must be a VirtualCamera"):
        GigEServer("camera")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="interface must be an IPv4 address"):
        require_free_address("lo; reboot")
    with pytest.raises(CameraError, match=r"interface must be an address of this machine; got 192\.0\.2\.77"):
        require_free_address("192.0.2.77")  # reserved for documentation


def test_a_missing_library_is_one_sentence(camera: VirtualCamera) -> None:
    def absent() -> NoReturn:
        raise MissingExtraError("cameras through Aravis need its library")

    with pytest.raises(MissingExtraError, match="need its library"), GigEServer(camera, library=absent):
        pass
    assert GigEServer(camera, serial="A1").identity == "tsis-VirtualProbe-A1"
