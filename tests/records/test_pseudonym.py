"""A pseudonym follows from a secret of the store: lasting in it, another one elsewhere, and in no export."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from sqlalchemy import delete, update
from tests.records.sample import WHEN, levels, sample_record

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

    from tests.records.place import Place

    from tsis.records.store import Store
    from tsis.records.values import TargetRecord


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
