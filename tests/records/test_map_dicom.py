"""DICOM files of a map, read back by pydicom and highdicom."""

from __future__ import annotations

import sys
from dataclasses import replace
from io import BytesIO
from typing import TYPE_CHECKING

import highdicom
import numpy as np
import pydicom
import pytest
from tests.present.test_lump_map import map_of

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import FileInputError, MissingExtraError, UntrustedError
from tsis.files.result_folder import write_folder
from tsis.mapping.scan import Scan, ScanPress
from tsis.present.lump_map import map_report
from tsis.records.map_dicom import map_dicom_files

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.mapping.lump_map import MapNumbers


HOSTILE = "Doe^Jane\\..\n<b>1970</b>"
DICOM_NAMES = {"modulus-kpa.dcm", "probability.dcm"}


def numbers_of(seed: int) -> MapNumbers:
    """Numbers of a map whose voxels are 2 mm by 1.5 mm by 0.7 mm."""
    numbers = map_of(seed).numbers
    return replace(
        numbers,
        y_mm=3.25 + 1.5 * np.arange(len(numbers.y_mm), dtype=np.float64),
        depth_mm=0.35 + 0.7 * np.arange(len(numbers.depth_mm), dtype=np.float64),
    )


def scan_of(name: str) -> Scan:
    rings = np.array([1.0, 0.9, 0.8])
    presses = tuple(ScanPress(place_mm=(x, 0.0), pressure_kpa=rings, force_n=1.0) for x in (0.0, 10.0))
    return Scan(presses=presses, name=name)


def instances(numbers: MapNumbers) -> dict[str, BytesIO]:
    return {file.name: BytesIO(file.content) for file in map_dicom_files(numbers)}


def test_highdicom_reads_the_numbers_where_the_map_has_them() -> None:
    numbers = numbers_of(31)
    files = instances(numbers)
    segmentation = highdicom.seg.segread(files["probability.dcm"])
    assert segmentation.SegmentationFractionalType == "PROBABILITY"
    share = segmentation.get_volume(combine_segments=False)
    modulus = highdicom.imread(files["modulus-kpa.dcm"]).get_volume(apply_real_world_transform=True)
    np.testing.assert_allclose(share.array[..., 0], numbers.probability, rtol=0.0, atol=0.5 / 255 + 1e-7)
    np.testing.assert_array_equal(modulus.array, numbers.modulus_kpa.astype(np.float32))
    assert share.frame_of_reference_uid == modulus.frame_of_reference_uid
    z, y, x = np.meshgrid(-numbers.depth_mm, numbers.y_mm, numbers.x_mm, indexing="ij")
    voxels = np.stack(np.meshgrid(*map(np.arange, z.shape), indexing="ij"), axis=-1).reshape(-1, 3)
    for volume in (share, modulus):
        places = volume.map_indices_to_reference(voxels)
        np.testing.assert_allclose(places, np.stack([x, y, z], axis=-1).reshape(-1, 3), atol=1e-9)


@pytest.mark.parametrize("at", range(2))
def test_frames_have_places_and_spacing_of_the_planes(at: int) -> None:
    numbers = numbers_of(32)
    dataset = map_dicom_files(numbers)[at].dataset()
    places = [
        [float(number) for number in group.PlanePositionSequence[0].ImagePositionPatient]
        for group in dataset.PerFrameFunctionalGroupsSequence
    ]
    first = (numbers.x_mm[0], numbers.y_mm[0])
    np.testing.assert_allclose(places, [(*first, -depth) for depth in numbers.depth_mm], atol=1e-9)
    measures = dataset.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0]
    assert [*measures.PixelSpacing, measures.SliceThickness] == pytest.approx([1.5, 2.0, 0.7])


def test_every_file_says_what_it_is_and_nothing_of_the_scan() -> None:
    files = map_report(map_of(33), scan_of(HOSTILE)).volumes
    assert files.keys() >= DICOM_NAMES
    for name in DICOM_NAMES:
        assert b"Jane" not in files[name]
        dataset = pydicom.dcmread(BytesIO(files[name]))
        assert dataset.ImageComments == RESEARCH_USE_ONLY
        assert dataset.ContentDescription.endswith("research use only")
        assert dataset.PatientIdentityRemoved == "YES"
        assert dataset.PatientID.startswith("SCAN-")
    assert dataset.StudyDate == ""


def test_the_segmentation_cites_the_modulus() -> None:
    modulus, probability = (file.dataset() for file in map_dicom_files(numbers_of(34)))
    assert [item.ReferencedSOPInstanceUID for item in probability.SourceImageSequence] == [modulus.SOPInstanceUID]
    assert "SourceImageSequence" not in modulus
    assert probability.StudyInstanceUID == modulus.StudyInstanceUID
    assert probability.SeriesInstanceUID != modulus.SeriesInstanceUID


def test_equal_maps_are_equal_instances_and_others_are_not() -> None:
    one, again, other = (map_dicom_files(numbers_of(seed)) for seed in (35, 35, 36))
    assert one == again
    for first, second in zip(one, other, strict=True):
        for name in ("SOPInstanceUID", "StudyInstanceUID", "SeriesInstanceUID", "FrameOfReferenceUID", "PatientID"):
            assert first.dataset()[name].value != second.dataset()[name].value


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_map_of_one_plane_and_one_certainty_is_written(share: float) -> None:
    numbers = numbers_of(37)
    flat = {
        name: np.full_like(getattr(numbers, name)[:1], value)
        for name, value in (("probability", share), ("modulus_kpa", 5.0), ("modulus_sd_kpa", 0.1))
    }
    plane = replace(numbers, depth_mm=numbers.depth_mm[:1], blind_diameter_mm=numbers.blind_diameter_mm[:1], **flat)
    segmentation = highdicom.seg.segread(instances(plane)["probability.dcm"])
    assert np.unique(segmentation.pixel_array).tolist() == [255 * share]


def test_an_untrusted_map_has_no_files() -> None:
    untrusted = replace(map_of(38), trusted=False, flags=("map_does_not_fit",))
    assert map_report(untrusted, scan_of("left")).volumes == {}
    with pytest.raises(UntrustedError, match="map_does_not_fit"):
        map_dicom_files(untrusted.numbers)


def test_without_the_extra_a_map_lacks_these_files_and_asking_for_them_names_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = map_of(39)
    monkeypatch.setitem(sys.modules, "highdicom", None)
    with pytest.raises(MissingExtraError, match=r"DICOM of a map needs highdicom.*tsis\[dicom\]"):
        map_dicom_files(found.numbers)
    volumes = map_report(found, scan_of("left")).volumes
    assert "map.vti" in volumes
    assert not DICOM_NAMES & volumes.keys()


def test_a_folder_that_exists_is_not_written_over(tmp_path: Path) -> None:
    files = map_report(map_of(40), scan_of("left")).volumes
    folder = write_folder(tmp_path / "map", files)
    before = (folder / "probability.dcm").read_bytes()
    with pytest.raises(FileInputError, match="must be a folder that can be made"):
        write_folder(folder, map_report(map_of(41), scan_of("left")).volumes)
    assert (folder / "probability.dcm").read_bytes() == before
