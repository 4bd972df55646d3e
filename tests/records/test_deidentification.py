"""What a de-identified export does not say, what an identified one does, and the pseudonym that stands for a name."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from sqlalchemy import delete, update
from tests.records.sample import WHEN, levels, sample_record
from tests.records.variants import FRAME, NAME, NOTE, SECRETS, SETTING, TARGET_ID, framed, named, noise

from tsis.errors import RecordsError
from tsis.model.image import TactileImage
from tsis.records import schema as tables
from tsis.records.arrays import write_netcdf, write_zarr
from tsis.records.database import TERM, read_secret
from tsis.records.deidentification import hidden_identity, pseudonym, public_identity
from tsis.records.dicom import dicom_files
from tsis.records.export import csv_files
from tsis.records.store import open_store, verify_store
from tsis.records.target import read_bundle, write_bundle

if TYPE_CHECKING:
    from pathlib import Path

    from tests.records.conftest import Place

    from tsis.records.store import Store
    from tsis.records.values import TargetRecord


DATES = ("20261122", "2026-11-22", "0930", "20261122093", "00003")


def every_uid(content: bytes) -> set[bytes]:
    return set(re.findall(rb"2\.25\.\d+", content))


def test_nothing_that_identifies_is_in_any_byte() -> None:
    files = dicom_files(named())
    assert len(files) == 3
    for file in files:
        readable = file.content
        if "PixelData" in (image := file.dataset()):
            readable = readable.replace(image.PixelData, b"")  # noise, in which any short word may occur
        for word in (*SECRETS, *DATES):
            assert word.casefold().encode() not in readable.lower(), (file.name, word)
            assert word.casefold() not in file.name
        for text in (NAME, NOTE, FRAME, SETTING):
            assert text.encode() not in readable
        assert not re.search(rb"2026", re.sub(rb"2\.25\.\d+", b"", readable))


def test_the_search_finds_them_in_an_identified_export() -> None:
    everything = b"".join(file.content for file in dicom_files(named(), identified=True))
    for word in ("Zwölf", "Quagmire", "20261122", "quill", "quorn", "quaint"):
        assert word.encode() in everything, word
    for word in ("Quincy", "Quasimodo", TARGET_ID):  # settings, calibrations and the identity are in no export
        assert word.encode() not in everything, word


def test_what_says_that_it_was_de_identified() -> None:
    image = dicom_files(named())[0].dataset()
    assert image.PatientIdentityRemoved == "YES"
    assert [each.CodeValue for each in image.DeidentificationMethodCodeSequence] == ["113100", "113104", "113105"]
    assert len(image.DeidentificationMethod) == 4
    assert image.LongitudinalTemporalInformationModified == "REMOVED"
    assert (image.StudyDate, image.StudyTime, image.ContentDate, image.ContentTime) == ("", "", "", "")
    assert "SeriesDate" not in image
    assert "AcquisitionDateTime" not in image
    report = dicom_files(named())[-1].dataset()
    assert (report.ContentDate, report.ContentTime) == ("19000101", "000000")


def test_the_pseudonym_is_that_of_the_target_and_of_nothing_else() -> None:
    first = dicom_files(named())[0].dataset()
    relabelled = replace(named(), target=replace(named().target, name="other", number=9))
    assert dicom_files(relabelled)[0].dataset().PatientID == first.PatientID
    assert re.fullmatch("TSIS-[0-9A-F]{12}", first.PatientID)
    for other in (
        replace(named(), target=replace(named().target, id="target-z")),
        replace(named(), secret="a5" * 32),
    ):
        assert dicom_files(other)[0].dataset().PatientID != first.PatientID


def test_an_identified_export_tells_label_and_time() -> None:
    image = dicom_files(named(), identified=True)[0].dataset()
    assert str(image.PatientName) == "Zwölf-Ünïcode 触覚 / label^"
    assert NAME in image.PatientComments
    assert (image.PatientID, image.StudyID) == (public_identity(named().target), "3")
    assert image.PatientID.startswith("subject-00003-")
    assert image.AcquisitionDateTime == f"{WHEN:%Y%m%d%H%M%S.%f}"
    assert image.TimezoneOffsetFromUTC == "+0000"


def test_the_two_exports_share_no_uid() -> None:
    hidden, result = dicom_files(sample_record()), dicom_files(sample_record(), identified=True)
    foreign = dicom_files(framed([noise(2, 2)], force_n=1.0))
    standing = every_uid(b"".join(file.content for file in foreign))
    for one in hidden:
        for other in result:
            shared = every_uid(one.content) & every_uid(other.content)
            assert shared <= standing, shared  # that of this program and its version, which every export bears


def test_the_same_is_exported_as_the_same_instance() -> None:
    assert dicom_files(sample_record()) == dicom_files(sample_record())
    uids = [file.sop_instance_uid for file in dicom_files(sample_record())]
    assert len(set(uids)) == len(uids)
    assert all(re.fullmatch(r"2\.25\.[1-9]\d{0,38}", uid) for uid in uids)


def test_another_content_is_another_instance_of_the_same_series() -> None:
    plain = sample_record()
    fewer = replace(plain, presses=plain.presses[1:])
    one, other = dicom_files(plain)[0].dataset(), dicom_files(fewer)[0].dataset()
    assert one.SeriesInstanceUID == other.SeriesInstanceUID
    assert one.SOPInstanceUID != other.SOPInstanceUID


def test_a_target_without_identity_is_refused() -> None:
    with pytest.raises(RecordsError, match="must have an identity"):
        dicom_files(replace(sample_record(), target=replace(sample_record().target, id="")))


def filled(store: Store) -> TargetRecord:
    target = store.add_target(name="size-10")
    store.add_press(target, TactileImage(grey=levels(0), full_scale=255.0, force_n=0.7), taken=WHEN)
    return store.record(target)


def secret_of(store: Store) -> str:
    with store.database.reading() as connection:
        return read_secret(connection)


def test_it_lasts_in_its_store(place: Place) -> None:
    with place.open() as store:
        first = filled(store)
    with place.open() as store:
        again = store.record(store.target(1))
        assert pseudonym(again) == pseudonym(first)
        assert dicom_files(again) == dicom_files(first)
        other = store.record(store.add_target())
    assert pseudonym(other) != pseudonym(first)


def test_who_has_the_identity_does_not_have_the_pseudonym(tmp_path: Path) -> None:
    with open_store(tmp_path / "one") as one, open_store(tmp_path / "other") as other:
        target_record = filled(one)
        write_bundle(target_record, tmp_path / "bundle")
        handed = read_bundle(tmp_path / "bundle")
        assert handed.target.id == target_record.target.id
        assert pseudonym(handed) != pseudonym(read_bundle(tmp_path / "bundle"))
        other.import_target(handed)
        taken = other.record(other.target(1))
        assert len({pseudonym(each) for each in (target_record, handed, taken)}) == 3
        assert public_identity(taken.target) == public_identity(target_record.target)  # that of identified exports


def test_no_export_holds_the_secret(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        record, secret = filled(store), secret_of(store)
        write_bundle(record, tmp_path / "out" / "bundle")
        write_netcdf(record, tmp_path / "out" / "one.nc")
        write_zarr(record, tmp_path / "out" / "one.zarr")
        assert verify_store(store).sound
    contents = [path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()]
    contents += csv_files(record).values()
    for identified in (False, True):
        contents += [file.content for file in dicom_files(record, identified=identified)]
    assert len(contents) > 12
    for content in contents:
        for each in (secret, record.secret):
            assert each.encode() not in content
            assert bytes.fromhex(each) not in content
    assert record.secret not in repr(record)


def test_a_secret_that_was_taken_out_is_not_made_anew(tmp_path: Path) -> None:
    for change in (delete(tables.store_table), update(tables.store_table).values(value="guessed")):
        with open_store(tmp_path / change.__visit_name__) as store:
            filled(store)
            with store.database.writing() as connection:
                connection.execute(change.where(tables.store_table.c.name == TERM))
            with pytest.raises(RecordsError, match="secret of the store, from which pseudonyms follow"):
                store.record(store.target(1))
            assert not verify_store(store).sound


def test_what_stands_for_an_identity_tells_kinds_apart() -> None:
    record = sample_record()
    assert hidden_identity(record, "press", "a") != hidden_identity(record, "estimate", "a")
    assert hidden_identity(record, "press", "a") != hidden_identity(replace(record, secret="00" * 32), "press", "a")
    assert hidden_identity(record, "press", "a") == hidden_identity(record, "press", "a")
