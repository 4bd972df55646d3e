"""Own images: bad files are named one by one, good ones are measured and saved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from tsis.console.services.captures import OwnImage, measure_images, open_images, save_images
from tsis.errors import InputError
from tsis.records.sources import ImportOptions
from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path

CENTRE, RADIUS_PX, SCALE_MM = (40.0, 30.0), 12.0, 0.1


def disc(folder: Path, name: str, *, light: float = 150.0) -> Path:
    """A frame with a bright disc of known centre and radius."""
    y, x = np.mgrid[0:60, 0:80]
    pressed = np.hypot(x - CENTRE[0], y - CENTRE[1]) <= RADIUS_PX
    file = folder / name
    Image.fromarray((20 + light * pressed).astype(np.uint8)).save(file)
    return file


@pytest.mark.parametrize("ending", ["png", "bmp", "tiff", "jpg"])
def test_every_image_form_is_opened(tmp_path: Path, ending: str) -> None:
    opened = open_images([disc(tmp_path, f"a.{ending}")], frames_in=tmp_path)
    assert [(image.name, image.columns, image.rows) for image in opened.images] == [(f"a.{ending}", 80, 60)]
    assert opened.refused == ()


def test_a_bad_file_is_named_and_the_good_ones_stay(tmp_path: Path) -> None:
    (tmp_path / "cut.png").write_bytes(disc(tmp_path, "b.png").read_bytes()[:60])
    (tmp_path / "notes.txt").write_text("no image")
    opened = open_images([tmp_path / name for name in ("cut.png", "b.png", "notes.txt")], frames_in=tmp_path)
    assert [image.name for image in opened.images] == ["b.png"]
    assert len(opened.refused) == 2
    assert "cut.png" in opened.refused[0]
    assert "notes.txt" in opened.refused[1]


def test_a_folder_gives_its_images_in_order(tmp_path: Path) -> None:
    for name in ("b.png", "a.bmp"):
        disc(tmp_path, name)
    assert [image.name for image in open_images([tmp_path], frames_in=tmp_path).images] == ["a.bmp", "b.png"]


def test_a_video_gives_its_frames(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    (frames := tmp_path / "frames").mkdir()
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (80, 60))
    for level in (30, 60, 90):
        writer.write(np.full((60, 80, 3), level, dtype=np.uint8))
    writer.release()
    opened = open_images([tmp_path / "v.avi"], frames_in=frames)
    assert [image.name for image in opened.images] == ["v-00000.png", "v-00001.png", "v-00002.png"]
    with Image.open(opened.images[2].path) as frame:
        assert abs(float(np.asarray(frame).mean()) - 90) < 3


def test_the_contact_is_measured_against_the_untouched_frame(tmp_path: Path) -> None:
    images = (
        OwnImage(path=disc(tmp_path, "press.png"), rows=60, columns=80),
        OwnImage(path=disc(tmp_path, "bare.png", light=0.0), rows=60, columns=80, role="untouched"),
    )
    (finding,), failed = measure_images(images, mm_per_pixel=(SCALE_MM, SCALE_MM))
    assert failed == ()
    assert finding.features.centroid_px == pytest.approx(CENTRE, abs=0.5)
    assert finding.features.equivalent_diameter_mm == pytest.approx(2 * RADIUS_PX * SCALE_MM, rel=0.1)


def test_frames_are_saved_with_their_role_and_force(tmp_path: Path) -> None:
    images = (
        OwnImage(path=disc(tmp_path, "press.png"), rows=60, columns=80, force_n=0.5),
        OwnImage(path=disc(tmp_path, "plain.png", light=90.0), rows=60, columns=80, role="plain", force_n=0.5),
    )
    with open_store(tmp_path / "store") as store:
        options = ImportOptions(mm_per_pixel=(SCALE_MM, SCALE_MM))
        assert save_images(store, images, number=None, options=options) == (1, 2)
        record = store.record(store.target(1))
        assert {(press.role, press.force_n) for press in record.presses} == {("target", 0.5), ("plain", 0.5)}
        with pytest.raises(InputError, match="at least one image"):
            save_images(store, (), number=None, options=options)
