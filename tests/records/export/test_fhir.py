import json
from dataclasses import replace
from typing import Any

import pytest
from fhir.resources.bundle import Bundle as BundleR5
from fhir.resources.R4B.bundle import Bundle as BundleR4B
from tests.records.dicom.variants import SECRETS, named
from tests.records.sample import sample_estimate, sample_record

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.records import TargetRecord
from tsis.records.export import fhir_observations


def observed(dossier: TargetRecord, **options: bool) -> dict[str, list[dict[str, Any]]]:
    """Observations by their code."""
    found: dict[str, list[dict[str, Any]]] = {}
    for entry in json.loads(fhir_observations(dossier, **options))["entry"]:
        if entry["resource"]["resourceType"] == "Observation":
            found.setdefault(entry["resource"]["code"]["coding"][0]["code"], []).append(entry["resource"])
    return found


def with_estimate(dossier: TargetRecord, **changes: Any) -> TargetRecord:
    stored = replace(dossier.estimates[0], estimate=replace(dossier.estimates[0].estimate, **changes))
    return replace(dossier, estimates=(stored,))


@pytest.mark.parametrize("kind", ["phantom", "subject"])
@pytest.mark.parametrize("identified", [True, False])
@pytest.mark.parametrize("trusted", [True, False])
@pytest.mark.parametrize("model", [BundleR4B, BundleR5], ids=["R4B", "R5"])
def test_the_bundle_is_valid_and_says_the_same_after_the_model(
    model: Any, trusted: bool, identified: bool, kind: str
) -> None:
    record = with_estimate(sample_record(kind=kind), trusted=trusted)
    content = fhir_observations(record, identified=identified)
    bundle = model.model_validate_json(content)
    assert json.loads(bundle.model_dump_json().replace('Z"', '+00:00"')) == json.loads(content)
    kinds = [type(entry.resource).__name__ for entry in bundle.entry]
    assert kinds == ["Patient" if kind == "subject" else "Device", "Device"] + 8 * ["Observation"]


@pytest.mark.parametrize("model", [BundleR4B, BundleR5], ids=["R4B", "R5"])
def test_the_judge_refuses_what_is_wrong(model: Any) -> None:
    content = json.loads(fhir_observations(sample_record()))
    content["entry"][5]["resource"]["value"] = 3
    with pytest.raises(ValueError, match="value"):
        model.model_validate(content)


def test_numbers_have_their_unit_and_their_interval() -> None:
    record = sample_record()
    found = observed(record)
    assert record.estimate is not None
    estimate = record.estimate.estimate
    (depth,) = found["depth_mm"]
    assert depth["valueQuantity"]["code"] == "mm"
    assert depth["valueQuantity"]["value"] == pytest.approx(estimate.mean["depth_mm"], rel=1e-5)
    parts = {part["code"]["coding"][0]["code"]: part["valueQuantity"] for part in depth["component"]}
    low, high = estimate.interval(0.9)["depth_mm"]
    assert [parts["interval-low"]["value"], parts["interval-high"]["value"]] == pytest.approx([low, high], rel=1e-5)
    assert {part["code"] for part in parts.values()} == {"mm"}
    assert [each["valueQuantity"]["value"] for each in found["force_n"]] == [0.7, 1.0, 0.7, 1.0]
    assert {each["valueQuantity"]["code"] for each in found["force_n"]} == {"N"}
    assert found["presence"][0]["valueQuantity"] == {
        "value": 0.97,
        "system": "http://unitsofmeasure.org",
        "code": "1",
    }
    assert "referenceRange" not in json.dumps(found)


def test_what_may_not_be_used_is_absent_with_its_reason() -> None:
    found = observed(sample_record())
    (young,) = found["young_kpa"]  # the sample says that it is not identified
    assert "valueQuantity" not in young
    assert young["dataAbsentReason"]["coding"][0]["code"] == "unknown"
    bound = next(part for part in young["component"] if part["code"]["coding"][0]["code"] == "cramer-rao-sd")
    assert bound["dataAbsentReason"]["coding"][0]["code"] == "positive-infinity"
    for name, each in observed(with_estimate(sample_record(), trusted=False, presence_trusted=False)).items():
        if name != "force_n":
            assert each[0]["dataAbsentReason"]["coding"][0]["code"] == "error"
            assert not {"valueQuantity", "component"} & set(each[0])


def test_times_and_names_are_told_only_when_asked_for() -> None:
    record = sample_record(kind="subject")
    record = replace(record, target=replace(record.target, name="P-17", note="Jane Doe, born 1950"))
    masked, result = fhir_observations(record).decode(), fhir_observations(record, identified=True).decode()
    for secret in ("2026", "P-17", "Jane", ".png", "target-a"):
        assert secret not in masked
    assert "target-a" not in result
    everything = fhir_observations(named()).decode().casefold()
    for secret in SECRETS:
        assert secret.casefold() not in everything
    assert "P-17" in result
    assert "Jane" not in result
    (depth,) = observed(record, identified=True)["depth_mm"]
    assert depth["effectiveDateTime"] == "2026-11-22T09:31:00+00:00"
    assert observed(record)["depth_mm"][0]["_effectiveDateTime"]["extension"][0]["valueCode"] == "masked"


def test_every_observation_is_preliminary_and_says_what_it_is_for() -> None:
    content = json.loads(fhir_observations(sample_record()))
    names = {entry["fullUrl"] for entry in content["entry"]}
    assert len(names) == len(content["entry"])
    for entry in content["entry"]:
        resource = entry["resource"]
        assert resource["note"] == [{"text": RESEARCH_USE_ONLY}]
        if resource["resourceType"] == "Observation":
            assert resource["status"] == "preliminary"
            assert {resource["subject"]["reference"], resource["device"]["reference"]} <= names
            assert resource["derivedFrom"][0]["identifier"]["value"].startswith("ni:///sha-256;")


def test_the_last_estimate_of_each_kind_is_told() -> None:
    record = sample_record()
    first = record.estimates[0]
    second = replace(first, estimate=replace(sample_estimate(), presence=0.5), id="b", supersedes=first.id)
    both = observed(replace(record, estimates=(first, second)))
    assert [each["valueQuantity"]["value"] for each in both["presence"]] == [0.5]
    assert "depth_mm" not in observed(replace(record, estimates=()))
    assert fhir_observations(record) == fhir_observations(sample_record())
