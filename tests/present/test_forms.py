"""Each form is what its own writer writes, in a place of its own."""

from __future__ import annotations

import hashlib
import zipfile
from typing import TYPE_CHECKING

import pytest
from tests.present.rough_pictures import rough_pictures
from tests.records.sample import sample_record

from tsis.errors import FileInputError
from tsis.files.result_folder import require_absent
from tsis.present.html import html_bytes
from tsis.present.records import ENDINGS, MASKED, PAGE_FORMS, write_form
from tsis.present.target import target_page

if TYPE_CHECKING:
    from pathlib import Path


def test_a_page_is_that_of_its_writer(tmp_path: Path) -> None:
    record = sample_record()
    with rough_pictures():
        assert write_form("html", record, tmp_path / "a.html", identified=False) == ""
        assert (tmp_path / "a.html").read_bytes() == html_bytes(target_page(record))


def test_a_bundle_is_known_by_the_sum_of_its_manifest(tmp_path: Path) -> None:
    seal = write_form("bundle", sample_record(), tmp_path / "a.zip", identified=False)
    with zipfile.ZipFile(tmp_path / "a.zip") as bundle:
        assert seal == hashlib.sha256(bundle.read("manifest.json")).hexdigest()


def test_nothing_is_written_over(tmp_path: Path) -> None:
    taken, link = tmp_path / "taken", tmp_path / "link"
    taken.write_text("mine")
    link.symlink_to(tmp_path / "nowhere")
    for path in (taken, link, tmp_path, tmp_path / ".."):
        with pytest.raises(FileInputError, match="must be a new name"):
            require_absent(path)
    with pytest.raises(FileInputError):
        write_form("html", sample_record(), taken, identified=False)
    assert taken.read_text() == "mine"
    require_absent(tmp_path / "new")


def test_forms_that_mask_or_are_pages_are_forms() -> None:
    assert {*PAGE_FORMS, *MASKED} < set(ENDINGS)
    assert len(set(ENDINGS.values())) == len(ENDINGS)
