"""What the report says, read back by highdicom and by walking its tree."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from highdicom.sr import ComprehensiveSR
from pydicom.sr.codedict import codes
from tests.records.dicom.variants import hardness, with_estimate, with_presses
from tests.records.sample import sample_estimate, sample_record

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.model.estimate import Estimate
from tsis.records.dicom import dicom_files

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pydicom.dataset import Dataset

    from tsis.records.values import TargetRecord

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
