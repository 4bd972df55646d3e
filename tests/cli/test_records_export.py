"""``tsis records export``: where a target goes, whole or not at all."""

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
    from tsis.present.records import write_form as whole

    def without_an_extra(form: str, *arguments: Any, **options: Any) -> Any:
        if form == "netcdf":
            raise MissingExtraError("netCDF export needs h5netcdf, which is not installed")
        return whole(form, *arguments, **options)

    monkeypatch.setattr("tsis.present.records.write_form", without_an_extra)
    finished = run_tsis("records", "export", "1", "--format", "html,netcdf", "--out", "given", *STORE)
    assert finished.code == 2
    assert "needs h5netcdf" in finished.err
    assert {path.name for path in tmp_path.iterdir()} == {"records"}


@pytest.mark.usefixtures("records")
def test_a_single_form_gets_a_name_of_its_own(run_tsis: RunTsis, tmp_path: Path) -> None:
    for form, name in (("html", "target-2.html"), ("csv", "target-2-csv"), ("bundle", "target-2.zip")):
        result = json.loads(run_tsis("records", "export", "2", "--format", form, *STORE, "--json").out)
        assert result["files"] == {form: str(tmp_path / name)}
        assert (tmp_path / name).exists()
        assert run_tsis("records", "export", "2", "--format", form, *STORE).code == 2
