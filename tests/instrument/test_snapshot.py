from __future__ import annotations

import hashlib
import json
from datetime import datetime
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

from tsis.errors import FileInputError, InputError, UnknownNameError
from tsis.files.atomic import write_durably
from tsis.instrument import snapshot as room
from tsis.instrument.camera import Frame
from tsis.instrument.image_files import read_image, read_levels
from tsis.instrument.snapshot import save_snapshot

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

WHEN = datetime(2011, 2, 4, 13, 11, 12)


def _frame(bits: int = 8) -> Frame:
    kind: Any = np.uint8 if bits == 8 else np.uint16
    levels = np.random.default_rng(bits).integers(0, 2**bits, (13, 17)).astype(kind)
    return Frame(
        pixels=levels, sequence=41, time_s=1.4, full_scale=2.0**bits - 1, name="camera#41", settings={"gain": 2.0}
    )


def _red(frame: Frame) -> NDArray[np.uint8]:
    levels = (frame.pixels * (255.0 / frame.full_scale)).astype(np.uint8)
    return np.dstack([levels, np.zeros_like(levels), np.zeros_like(levels)])


@pytest.mark.parametrize("picture", ["bmp", "png", "jpg"])
@pytest.mark.parametrize("bits", [8, 12])
def test_the_raw_frame_comes_back_bit_for_bit(tmp_path: Path, picture: str, bits: int) -> None:
    frame = _frame(bits)
    saved = save_snapshot(frame, tmp_path, target=1, when=WHEN, colour=_red, picture=picture)
    assert saved.colour == tmp_path / "Target1" / f"Target1-020411-131112.{picture}"
    assert saved.raw.stem == "Target1-020411-131112-raw"
    np.testing.assert_array_equal(read_image(saved.raw).grey, frame.pixels)
    colour = read_levels(saved.colour).astype(float)
    assert np.corrcoef(colour[..., 0].ravel(), frame.pixels.ravel().astype(float))[0, 1] > 0.8
    assert colour[..., 1].mean() < colour[..., 0].mean()


def test_the_sidecar_tells_how_it_was_taken_and_proves_the_files(tmp_path: Path) -> None:
    saved = save_snapshot(_frame(), tmp_path, target=3, when=WHEN, colour=_red, about={"calibration": "abc"})
    result = json.loads(saved.sidecar.read_text())
    assert (result["target"], result["sequence"], result["time_s"], result["settings"]) == (3, 41, 1.4, {"gain": 2.0})
    assert result["calibration"] == "abc"
    assert result["taken"].startswith("2011-02-04T13:11:12")
    assert "Research use only" in result["notice"]
    for ending, digest in result["sha256"].items():
        file = tmp_path / "Target3" / f"Target3-020411-131112{ending}"
        assert hashlib.sha256(file.read_bytes()).hexdigest() == digest


def test_nothing_is_ever_written_over(tmp_path: Path) -> None:
    first = save_snapshot(_frame(), tmp_path, target=1, when=WHEN, colour=_red)
    before = {file: file.read_bytes() for file in (first.colour, first.raw, first.sidecar)}
    stray = tmp_path / "Target1" / "Target1-020411-131112-2-raw.bmp"
    stray.write_bytes(b"somebody else's")
    third = save_snapshot(_frame(), tmp_path, target=1, when=WHEN, colour=_red)
    assert third.colour.name == "Target1-020411-131112-3.bmp"
    assert {file: file.read_bytes() for file in before} == before
    assert stray.read_bytes() == b"somebody else's"


@pytest.mark.parametrize("failing", [1, 2, 3])
def test_a_full_disk_leaves_nothing_of_this_snapshot_and_all_of_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int
) -> None:
    first = save_snapshot(_frame(), tmp_path, target=1, when=WHEN, colour=_red)
    before = sorted(first.raw.parent.iterdir())
    calls = iter(range(1, 10))

    def full(path: Path, content: bytes) -> None:
        if next(calls) == failing:
            raise OSError(28, "No space left on device")
        write_durably(path, content)

    monkeypatch.setattr(room, "write_durably", full)
    with pytest.raises(FileInputError, match=r"No space left on device \(free some space"):
        save_snapshot(_frame(), tmp_path, target=1, when=WHEN, colour=_red)
    assert sorted(first.raw.parent.iterdir()) == before


def test_a_file_where_the_folder_should_be_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "Target1").write_text("a file")
    with pytest.raises(FileInputError, match="must be written into"):
        save_snapshot(_frame(), tmp_path, target=1, when=WHEN, colour=_red)


def test_corrected_levels_and_unknown_formats_are_refused(tmp_path: Path) -> None:
    corrected = Frame(pixels=np.full((4, 4), 0.5), sequence=0)
    with pytest.raises(InputError, match="whole numbers"):
        save_snapshot(corrected, tmp_path, target=1, when=WHEN, colour=lambda _: np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(UnknownNameError, match="did you mean 'jpg'"):
        save_snapshot(_frame(), tmp_path, target=1, when=WHEN, colour=_red, picture="jpeg")
    assert not list(tmp_path.iterdir())


def test_bmp_files_are_24_bit_as_in_the_source(tmp_path: Path) -> None:
    saved = save_snapshot(_frame(), tmp_path, target=1, when=WHEN, colour=_red)
    stored = cv2.imread(str(saved.colour), cv2.IMREAD_UNCHANGED)
    assert stored is not None
    assert stored.shape == (13, 17, 3)
