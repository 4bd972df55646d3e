"""``tsis records export|send``: where a target goes, whole or not at all."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

STORE = ("--store", "records")


@pytest.mark.usefixtures("records")
def test_several_forms_appear_together_or_not_at_all(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tsis.errors import MissingExtraError
    from tsis.report import _forms as forms

    whole = forms.write_form

    def without_an_extra(form: str, *arguments: Any, **options: Any) -> Any:
        if form == "hdf5":
            raise MissingExtraError("HDF5 export needs h5py, which is not installed")
        return whole(form, *arguments, **options)

    monkeypatch.setattr("tsis.report.write_form", without_an_extra)
    finished = run_tsis("records", "export", "1", "--format", "html,hdf5", "--out", "given", *STORE)
    assert finished.code == 2
    assert "needs h5py" in finished.err
    assert {path.name for path in tmp_path.iterdir()} == {"records"}


@pytest.mark.usefixtures("records")
def test_a_single_form_gets_a_name_of_its_own(run_tsis: RunTsis, tmp_path: Path) -> None:
    for form, name in (("html", "target-2.html"), ("csv", "target-2-csv"), ("bundle", "target-2.zip")):
        result = json.loads(run_tsis("records", "export", "2", "--format", form, *STORE, "--json").out)
        assert result["files"] == {form: str(tmp_path / name)}
        assert (tmp_path / name).exists()
        assert run_tsis("records", "export", "2", "--format", form, *STORE).code == 2


@pytest.mark.usefixtures("records")
def test_sending_goes_where_it_was_told(run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("highdicom")
    asked: list[dict[str, Any]] = []

    def archive(files: Any, **options: Any) -> tuple[str, ...]:
        asked.append(options)
        return tuple(file.sop_instance_uid for file in files)

    monkeypatch.setattr("tsis.records.dicom.c_store", archive)
    monkeypatch.setattr("tsis.records.dicom.stow_rs", archive)
    monkeypatch.setenv("TSIS_DICOMWEB_TOKEN", "abc")
    for to in ("ORTHANC@127.0.0.1:4242", "ORTHANC@[::1]:4242", "https://archive.example/dicom-web"):
        finished = run_tsis("records", "send", "1", "--to", to, *STORE, "--json")
        assert finished.code == 0, finished.err
        assert len(json.loads(finished.out)["stored"]) == 2  # the frames, and the report on them
    assert [(each.get("host"), each.get("port"), each.get("called_ae")) for each in asked[:2]] == [
        ("127.0.0.1", 4242, "ORTHANC"),
        ("::1", 4242, "ORTHANC"),
    ]
    assert (asked[2]["url"], asked[2]["token"]) == ("https://archive.example/dicom-web", "abc")
