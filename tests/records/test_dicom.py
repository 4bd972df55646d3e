"""DICOM exports: frames as the camera gave them, reports read back by highdicom, and files whole or absent."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest
from highdicom.sr import ComprehensiveSR
from hypothesis import given, settings
from hypothesis import strategies as st
from pydicom.sr.codedict import codes
from tests.records.sample import WHEN, sample_estimate, sample_record
from tests.records.variants import framed, hardness, noise, with_estimate, with_presses

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import MissingExtraError, RecordsError
from tsis.files import atomic as durable
from tsis.model.estimate import Estimate
from tsis.records.dicom import dicom_files, write_dicom

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

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


MEAN, SD, LOW, HIGH = "373098007", "386136009", "371888009", "371889001"


def report(dossier: TargetRecord, *, identified: bool = False) -> Dataset:
    return dicom_files(dossier, identified=identified)[-1].dataset()


def items(parent: Dataset) -> Iterator[Dataset]:
    for item in parent.get("ContentSequence", []):
        yield item
        yield from items(item)


def numbers(dossier: TargetRecord) -> dict[tuple[str, str], tuple[float, str]]:
    """Concept and derivation -> value and unit, of the estimate alone."""
    found = {}
    for item in items(report(dossier)):
        if item.ValueType == "NUM" and item.ConceptNameCodeSequence[0].CodeValue != "111647":
            value = item.MeasuredValueSequence[0]
            by = {each.ConceptNameCodeSequence[0].CodeValue: each for each in item.get("ContentSequence", [])}
            derivation = by["121401"].ConceptCodeSequence[0].CodeValue if "121401" in by else ""
            key = (item.ConceptNameCodeSequence[0].CodeMeaning, derivation)
            found[key] = (float(value.NumericValue), value.MeasurementUnitsCodeSequence[0].CodeValue)
    return found


def texts(dossier: TargetRecord, *, identified: bool = False) -> list[tuple[str, str]]:
    return [
        (item.ConceptNameCodeSequence[0].CodeMeaning, item.TextValue)
        for item in items(report(dossier, identified=identified))
        if item.ValueType == "TEXT"
    ]


def test_numbers_are_those_of_the_estimate() -> None:
    estimate = sample_estimate()
    found = numbers(sample_record())
    for name, concept in (("diameter_mm", "Diameter"), ("depth_mm", "Depth")):
        samples = np.asarray(estimate.samples[name])
        low, high = np.quantile(samples, [0.05, 0.95])
        for derivation, expected in ((MEAN, samples.mean()), (SD, samples.std()), (LOW, low), (HIGH, high)):
            value, unit = found[concept, derivation]
            assert value == pytest.approx(expected, rel=1e-5)
            assert unit == "mm"
    assert found["Probability", ""] == (0.97, "1")


def test_a_parameter_that_is_not_identified_has_a_range_alone() -> None:
    found = numbers(sample_record())
    assert {derivation for concept, derivation in found if concept == "Elasticity"} == {LOW, HIGH}
    assert found["Elasticity", LOW][1] == "kPa"
    assert ("Parameter without a number", "young_kpa") in texts(sample_record())


def test_a_parameter_without_a_code_is_named_without_a_number() -> None:
    estimate = Estimate(samples={"slip_mm": np.array([1.0, 2.0])}, prior_sd={"slip_mm": 1.0})
    record = with_estimate(sample_record(), estimate)
    assert numbers(record) == {}
    assert ("Parameter without a number", "other_1_mm") in texts(record)
    assert ("Parameter without a number", "slip_mm") in texts(record, identified=True)


def test_an_untrusted_estimate_has_no_numbers_anywhere() -> None:
    result = replace(
        sample_estimate(trusted=False), identifiability="Diameter 9.8 ± 0.4 mm.", flags=("model_does_not_fit",)
    )
    record = with_estimate(sample_record(), result)
    assert numbers(record) == {}
    said = texts(record)
    assert ("Quality flag", "model_does_not_fit") in said
    assert not any("9.8" in sentence for _, sentence in said)
    evaluation = [item for item in items(report(record)) if item.ValueType == "CODE"]
    answers = {
        each.ConceptNameCodeSequence[0].CodeMeaning: each.ConceptCodeSequence[0].CodeMeaning for each in evaluation
    }
    assert answers["Model holds, numbers may be used"] == "No"


def test_hardness_is_a_modulus_with_a_mean() -> None:
    record = with_estimate(sample_record(), hardness(), "hardness", tsis="0.0.9", code_sha256="ab" * 32)
    found = numbers(record)
    assert found["Elasticity", MEAN][0] == pytest.approx(hardness().mean["young_kpa"], rel=1e-5)
    assert found["Elasticity", MEAN][1] == "kPa"
    assert {concept for concept, _ in found} == {"Elasticity"}
    said = texts(record)
    assert ("Algorithm Name", "tsis hardness") in said
    assert ("Algorithm Version", "0.0.9") in said  # of the program that computed it
    assert ("Algorithm Parameters", f"code_sha256={'ab' * 32}") in said


def test_forces_belong_to_frames() -> None:
    record = sample_record()
    image = dicom_files(record)[0].dataset()
    found: dict[tuple[str, Any], float] = {}
    for group in items(report(record)):
        inner = list(group.get("ContentSequence", []))
        force = [each for each in inner if each.ConceptNameCodeSequence[0].CodeValue == "111647"]
        if force:
            (source,) = [each.ReferencedSOPSequence[0] for each in inner if each.ValueType == "IMAGE"]
            found[source.ReferencedSOPInstanceUID, source.ReferencedFrameNumber] = float(
                force[0].MeasuredValueSequence[0].NumericValue
            )
    assert found[image.SOPInstanceUID, 1] == 0.7
    assert found[image.SOPInstanceUID, 2] == 1.0
    assert len(found) == 4


def test_highdicom_reads_it_as_a_measurement_report() -> None:
    document = ComprehensiveSR.from_dataset(report(sample_record()))
    content: Any = document.content
    groups = content.get_image_measurement_groups()
    assert len(groups) == 5
    measured = groups[0].get_measurements(name=codes.SCT.Diameter)
    assert [each.unit.value for each in measured] == ["mm"] * 4
    evidence = {str(uid) for _, _, uid, _ in document.get_evidence()}
    assert evidence == {file.sop_instance_uid for file in dicom_files(sample_record())[:-1]}


def test_the_notice_comes_first() -> None:
    document = report(sample_record())
    meanings = [item.ConceptNameCodeSequence[0].CodeMeaning for item in document.ContentSequence]
    assert meanings.index("Notice") < meanings.index("Imaging Measurements")
    assert ("Notice", RESEARCH_USE_ONLY) in texts(sample_record())


def test_the_guards_flags_are_told() -> None:
    assert ("Quality flag", "moving") in texts(sample_record(estimated=False))


def test_nothing_known_is_no_report() -> None:
    record = with_presses(sample_record(estimated=False), force_n=None, flags=())
    assert all("report" not in file.name for file in dicom_files(record))


def test_the_last_estimate_of_each_kind_is_told() -> None:
    record = sample_record()
    (hard,) = with_estimate(record, hardness(), "hardness").estimates
    first = replace(record.estimates[0], estimate=replace(sample_estimate(), presence=0.5), id="estimate-0")
    both = replace(record, estimates=(first, *record.estimates, hard))
    for identified in (False, True):
        said = texts(both, identified=identified)
        assert [text for what, text in said if what == "Algorithm Name"] == ["tsis inclusion", "tsis hardness"]
    found = numbers(both)
    assert found["Probability", ""] == (0.97, "1")
    assert found["Diameter", MEAN][0] == pytest.approx(sample_estimate().mean["diameter_mm"], rel=1e-5)
    assert found["Elasticity", MEAN][0] == pytest.approx(hardness().mean["young_kpa"], rel=1e-5)
    assert report(both, identified=True).ContentTime == "093300.000000"  # of the newest


def test_files_are_named_by_a_pattern(tmp_path: Path) -> None:
    record = sample_record()
    names = [path.name for path in write_dicom(record, tmp_path / "new" / "folder")]
    stem = pydicom.dcmread(tmp_path / "new" / "folder" / names[0]).PatientID.lower()
    assert names == [f"{stem}-1-target-01.dcm", f"{stem}-2-plain-01.dcm", f"{stem}-9-report-01.dcm"]
    result = [path.name for path in write_dicom(record, tmp_path, identified=True)]
    assert result == ["tsis-00003-1-target-01.dcm", "tsis-00003-2-plain-01.dcm", "tsis-00003-9-report-01.dcm"]


def test_writing_again_changes_nothing(tmp_path: Path) -> None:
    first = [(path, path.read_bytes(), path.stat().st_ino) for path in write_dicom(sample_record(), tmp_path)]
    again = [(path, path.read_bytes(), path.stat().st_ino) for path in write_dicom(sample_record(), tmp_path)]
    assert first == again


def test_another_content_of_the_name_is_not_replaced(tmp_path: Path) -> None:
    path = write_dicom(sample_record(), tmp_path)[1]
    path.write_bytes(b"mine")
    for other in set(tmp_path.iterdir()) - {path}:
        other.unlink()
    with pytest.raises(RecordsError, match="is there with another content"):
        write_dicom(sample_record(), tmp_path)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"mine"


@pytest.mark.parametrize("step", ["sync", "name"])
@pytest.mark.parametrize("at", [1, 2, 3])
def test_a_disk_that_fails_at_any_file_leaves_no_half_of_a_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, at: int
) -> None:
    (tmp_path / "mine").write_bytes(b"mine")
    done: list[str] = []
    real = getattr(durable.Disk, step)

    def fail(*known: object) -> None:
        done.append("")
        if len(done) == at:
            raise OSError(28, "No space left on device")
        real(*known)

    monkeypatch.setattr(durable.Disk, step, fail)
    with pytest.raises(RecordsError, match=r"cannot be written to .*: No space left on device"):
        write_dicom(sample_record(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    monkeypatch.undo()
    assert len(write_dicom(sample_record(), tmp_path)) == 3


def test_a_new_folder_is_not_there_when_the_disk_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(durable.Disk, "sync", fail)
    with pytest.raises(RecordsError, match="No space left on device"):
        write_dicom(sample_record(), tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


def test_what_is_missing_of_a_set_is_written_and_the_rest_left(tmp_path: Path) -> None:
    paths = write_dicom(sample_record(), tmp_path)
    content, kept = paths[1].read_bytes(), paths[0].stat()
    paths[1].unlink()
    assert write_dicom(sample_record(), tmp_path) == paths
    assert paths[1].read_bytes() == content
    assert (paths[0].stat().st_ino, paths[0].stat().st_mtime_ns) == (kept.st_ino, kept.st_mtime_ns)


def test_a_folder_that_is_a_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(RecordsError, match="cannot be written to"):
        write_dicom(sample_record(), tmp_path / "taken")


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pydicom", None)
    with pytest.raises(MissingExtraError, match=r"DICOM needs pydicom.*tsis\[dicom\]"):
        dicom_files(sample_record())
