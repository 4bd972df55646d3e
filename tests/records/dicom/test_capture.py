"""Frames come back from a Secondary Capture instance as the camera gave them, read by pydicom."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.records.dicom.variants import framed, noise, with_presses
from tests.records.sample import WHEN, sample_record

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import RecordsError
from tsis.records.dicom import dicom_files

if TYPE_CHECKING:
    from pydicom.dataset import Dataset

    from tsis.records.values import TargetRecord

SINGLE = "1.2.840.10008.5.1.4.1.1.7"
BYTES, WORDS = f"{SINGLE}.2", f"{SINGLE}.3"


def images(dossier: TargetRecord, *, identified: bool = False) -> list[Dataset]:
    found = [file.dataset() for file in dicom_files(dossier, identified=identified)]
    return [each for each in found if "PixelData" in each]


@settings(max_examples=60)
@given(
    rows=st.integers(1, 40),
    columns=st.integers(1, 40),
    frames=st.integers(1, 4),
    bits=st.sampled_from([8, 9, 10, 12, 14, 16]),
    seed=st.integers(0, 2**31),
    scale=st.none() | st.tuples(st.floats(1e-4, 10), st.floats(1e-4, 10)),
)
def test_frames_and_scale_come_back(
    rows: int, columns: int, frames: int, bits: int, seed: int, scale: tuple[float, float] | None
) -> None:
    given_frames = [noise(rows, columns, bits=bits, seed=seed + i) for i in range(frames)]
    (image,) = images(framed(given_frames, full_scale=2.0**bits - 1, mm_per_pixel=scale))
    back = np.reshape(image.pixel_array, (frames, rows, columns))
    assert back.dtype == given_frames[0].dtype
    np.testing.assert_array_equal(back, given_frames)
    assert image.SOPClassUID == (SINGLE if frames == 1 else BYTES if bits == 8 else WORDS)
    assert image.BitsStored == bits
    assert len(image.PixelData) % 2 == 0
    if scale is None:
        assert "PixelSpacing" not in image
    else:  # the distance of rows, y, comes first; 16 characters hold at least 11 digits of these
        np.testing.assert_allclose([float(each) for each in image.PixelSpacing], scale[::-1], rtol=1e-10)


def test_grey_levels_above_full_scale_are_kept() -> None:
    frame = np.array([[5000, 4095]], dtype=np.uint16)
    (image,) = images(framed([frame], full_scale=4095.0))
    np.testing.assert_array_equal(image.pixel_array, frame)
    assert image.BitsStored == 13


def test_series_are_the_roles_and_frames_their_times() -> None:
    first, second = images(sample_record())
    assert first.SeriesInstanceUID != second.SeriesInstanceUID
    assert first.StudyInstanceUID == second.StudyInstanceUID
    assert "target" in first.SeriesDescription
    assert "reference" in second.SeriesDescription
    assert first["FrameIncrementPointer"].value == 0x00181065
    assert [float(each) for each in first.FrameTimeVector] == [0.0, 20_000.0]


def test_frames_are_in_the_order_of_their_times() -> None:
    record = framed([noise(3, 3, seed=seed) for seed in range(3)])
    moved = replace(record.presses[0], taken=WHEN + timedelta(minutes=1))
    (image,) = images(replace(record, presses=(moved, *record.presses[1:])))
    expected = [record.levels(record.presses[i]) for i in (1, 2, 0)]
    np.testing.assert_array_equal(image.pixel_array, expected)
    assert [float(each) for each in image.FrameTimeVector] == [0.0, 1_000.0, 58_000.0]


def test_frames_of_other_size_depth_or_scale_are_instances_of_their_own() -> None:
    found = images(framed([noise(3, 4), noise(4, 3), noise(3, 4, bits=16), noise(3, 4, seed=1)]))
    assert [(each.Rows, each.Columns, each.BitsAllocated, each.get("NumberOfFrames", 1)) for each in found] == [
        (3, 4, 8, 2),
        (4, 3, 8, 1),
        (3, 4, 16, 1),
    ]
    assert [each.InstanceNumber for each in found] == [1, 2, 3]
    assert len({each.SeriesInstanceUID for each in found}) == 1


def test_long_series_are_cut_into_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tsis.records.dicom._MOST_BYTES", 30)
    frames = [noise(3, 4, seed=seed) for seed in range(5)]
    found = images(framed(frames))
    assert [int(each.get("NumberOfFrames", 1)) for each in found] == [2, 2, 1]
    np.testing.assert_array_equal(np.concatenate([each.pixel_array.reshape(-1, 3, 4) for each in found]), frames)


@pytest.mark.parametrize("identified", [False, True])
@pytest.mark.parametrize("kind", ["phantom", "subject"])
def test_every_instance_says_what_it_is(kind: str, identified: bool) -> None:
    for image in images(sample_record(kind=kind), identified=identified):
        assert image.ImageComments.startswith(RESEARCH_USE_ONLY)
        assert image.QualityControlSubject == ("YES" if kind == "phantom" else "NO")
        assert image.PatientIdentityRemoved == ("NO" if identified else "YES")
        assert (image.WindowCenter, image.WindowWidth) == (128, 256)


def test_a_frame_that_is_not_what_its_press_says_is_refused() -> None:
    record = with_presses(framed([noise(3, 4)]), rows=4)
    with pytest.raises(RecordsError, match=r"must hold 4 x 4 grey levels of 8 or 16 bits.*; got shape \(3, 4\)"):
        dicom_files(record)


def test_no_press_is_refused() -> None:
    with pytest.raises(RecordsError, match="at least one press"):
        dicom_files(replace(sample_record(), presses=()))


def test_another_probe_is_another_series_that_starts_with_its_own_first_press() -> None:
    record = framed([noise(3, 4), noise(3, 4, seed=1), noise(5, 4, seed=2), noise(4, 3, seed=3)])
    probes, times = ("tsis-2011", "tsis-domed", "tsis-2011", "mine"), (3, 0, 2, 1)
    presses = tuple(
        replace(press, probe=probe, taken=WHEN + timedelta(days=day))
        for press, probe, day in zip(record.presses, probes, times, strict=True)
    )
    for identified, third in ((False, "other probe"), (True, "mine")):
        series: dict[str, set[tuple[str, ...]]] = {}
        for image in images(replace(record, presses=presses), identified=identified):
            said = (image.SeriesDescription, str(image.SeriesNumber), image.get("SeriesDate", ""))
            series.setdefault(image.SeriesInstanceUID, set()).add(said)
        assert all(len(said) == 1 for said in series.values())
        assert sorted((what.split("probe ")[1], *rest) for ((what, *rest),) in series.values()) == sorted(
            (probe, number, date if identified else "")
            for probe, number, date in (
                ("tsis-domed", "1", "20261122"),
                (third, "11", "20261123"),
                ("tsis-2011", "21", "20261124"),
            )
        )


def test_nobody_says_that_no_writing_is_in_a_file_that_nobody_looked_at() -> None:
    frames = [noise(3, 4), noise(3, 4, seed=1)]
    (single,) = images(framed(frames[:1]))
    assert "BurnedInAnnotation" not in single
    from_file = {"format": "PNG", "kind": "grey", "camera": "files"}
    for settings_, said in (
        ({}, "YES"),
        (from_file, "YES"),
        ({"camera": "DMK 33"}, "NO"),
        ({"source": "virtual"}, "NO"),
    ):
        for identified in (False, True):
            (many,) = images(framed(frames, settings=settings_), identified=identified)
            assert many.BurnedInAnnotation == said
            assert "RecognizableVisualFeatures" not in many
    mixed = framed(frames, settings={"camera": "DMK 33"})
    mixed = replace(mixed, presses=(mixed.presses[0], replace(mixed.presses[1], settings={})))
    assert images(mixed)[0].BurnedInAnnotation == "YES"
