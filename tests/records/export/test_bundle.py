import hashlib
import json
import os
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.records.export.bundles import files_of, plain, sealed
from tests.records.sample import sample_record

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.calibration.file import calibration_bytes
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.records.target import read_bundle, write_bundle
from tsis.records.values import TargetRecord


@pytest.mark.parametrize("name", ["out", "out.zip"])
@pytest.mark.parametrize("full_scale", [255.0, 4095.0])
@pytest.mark.parametrize("kind", ["phantom", "subject"])
def test_a_dossier_comes_back_as_it_was(tmp_path: Path, name: str, full_scale: float, kind: str) -> None:
    record = sample_record(full_scale=full_scale, kind=kind)
    write_bundle(record, tmp_path / name)
    back = read_bundle(tmp_path / name)
    assert plain(back) == plain(record)
    for press in record.presses:
        assert back.levels(press).dtype == record.levels(press).dtype
        np.testing.assert_array_equal(back.levels(press), record.levels(press))
    for cited, known in record.calibrations.items():
        assert calibration_bytes(back.calibrations[cited]) == calibration_bytes(known)
    assert list(tmp_path.iterdir()) == [tmp_path / name]


def test_a_target_without_presses_is_a_bundle_too(tmp_path: Path) -> None:
    record = sample_record(estimated=False)
    bare = TargetRecord(target=record.target, presses=(), read=record.read)
    write_bundle(bare, tmp_path / "out")
    assert plain(read_bundle(tmp_path / "out")) == plain(bare)


def test_equal_dossiers_are_equal_bundles_named_by_their_manifest(tmp_path: Path) -> None:
    seals = [write_bundle(sample_record(), tmp_path / name) for name in ("a", "b.zip", "c.zip")]
    assert len(set(seals)) == 1
    assert (tmp_path / "b.zip").read_bytes() == (tmp_path / "c.zip").read_bytes()
    content = (tmp_path / "a" / "manifest.json").read_bytes()
    assert hashlib.sha256(content).hexdigest() == seals[0]
    manifest = json.loads(content)
    assert manifest["notice"] == RESEARCH_USE_ONLY
    for name, entry in manifest["files"].items():
        found = (tmp_path / "a" / name).read_bytes()
        assert entry == {"sha256": hashlib.sha256(found).hexdigest(), "bytes": len(found)}


def test_a_folder_zipped_by_another_program_is_read(tmp_path: Path) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    with zipfile.ZipFile(tmp_path / "own.zip", "w", zipfile.ZIP_DEFLATED) as file:
        for path in sorted((tmp_path / "out").rglob("*")):
            file.write(path, str(path.relative_to(tmp_path / "out")))
    assert plain(read_bundle(tmp_path / "own.zip")) == plain(sample_record())


@pytest.mark.parametrize("name", ["out", "out.zip"])
def test_nothing_is_written_over(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"mine")
    with pytest.raises(FileInputError, match="must be a new name"):
        write_bundle(sample_record(), tmp_path / name)
    assert (tmp_path / name).read_bytes() == b"mine"
    assert list(tmp_path.iterdir()) == [tmp_path / name]


@pytest.mark.parametrize("name", ["out", "out.zip"])
def test_what_could_not_be_read_back_is_not_written(tmp_path: Path, name: str) -> None:
    record = sample_record()
    wrong = [
        replace(record, calibrations={}),
        replace(record, presses=record.presses[1:]),  # on which the estimate rests
        replace(record, presses=(replace(record.presses[0], columns=149), *record.presses[1:])),
    ]
    for each in wrong:
        with pytest.raises((RecordsError, InputError)):
            write_bundle(each, tmp_path / name)
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name", ["manifest.json", "target.json", "presses.json", "estimates.json", "frames", "calibrations", "samples"]
)
def test_a_changed_missing_or_grown_file_is_named(tmp_path: Path, name: str) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    path = tmp_path / "out" / name
    if path.is_dir():
        path = min(path.iterdir())
    whole = path.read_bytes()
    changed = bytes([*whole[:-5], whole[-5] ^ 1, *whole[-4:]])
    for content in (changed, whole[:-1], whole + b" ", b""):
        path.write_bytes(content)
        with pytest.raises(FileInputError, match=path.name):
            read_bundle(tmp_path / "out")
    path.unlink()
    with pytest.raises(FileInputError, match=path.name):
        read_bundle(tmp_path / "out")


def test_a_frame_changed_after_the_bundle_was_read_is_refused_when_it_is_asked_for(tmp_path: Path) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    back = read_bundle(tmp_path / "out")
    path = tmp_path / "out" / "frames" / f"{back.presses[0].frame}.png"
    content = bytearray(path.read_bytes())
    content[60] ^= 1
    path.write_bytes(content)
    with pytest.raises(FileInputError, match=path.name):
        back.levels(back.presses[0])


@pytest.mark.parametrize(
    "name", ["extra.json", "frames/extra.png", "frames/a/b.png", "samples/00001.samples", ".hidden"]
)
def test_unknown_files_are_refused_by_name(tmp_path: Path, name: str) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    path = tmp_path / "out" / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"x")
    with pytest.raises(FileInputError, match=name.split("/b")[0].replace(".", r"\.")):
        read_bundle(tmp_path / "out")


@pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")
@pytest.mark.parametrize("what", ["link", "pipe", "folder link"])
def test_links_and_devices_are_refused(tmp_path: Path, what: str) -> None:
    write_bundle(sample_record(), tmp_path / "out")
    path = tmp_path / "out" / "target.json"
    if what == "folder link":
        path = tmp_path / "out" / "samples"
    path.rename(tmp_path / "elsewhere")
    if what == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FileInputError, match=path.name):
        read_bundle(tmp_path / "out")


@pytest.mark.parametrize(
    "name", ["../target.json", "/etc/passwd", "C:\\x", "frames\\a.png", "x/", "targets/target.json"]
)
def test_zip_files_with_other_names_are_refused(tmp_path: Path, name: str) -> None:
    write_bundle(sample_record(), tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip", "a") as file:
        file.writestr(name, b"x")
    with pytest.raises(FileInputError, match="must not be in a bundle"):
        read_bundle(tmp_path / "out.zip")


def test_a_name_twice_in_a_zip_file_is_refused(tmp_path: Path) -> None:
    write_bundle(sample_record(), tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip", "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr("target.json", b"{}")
    with pytest.raises(FileInputError, match="every name once"):
        read_bundle(tmp_path / "out.zip")


def test_what_is_no_bundle_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.zip").write_bytes(b"PK" * 100)
    (tmp_path / "short.zip").write_bytes(b"PK")
    (tmp_path / "empty").mkdir()
    for name in ("text.zip", "short.zip", "empty", "nowhere"):
        with pytest.raises(FileInputError):
            read_bundle(tmp_path / name)


def test_a_bundle_of_a_later_version_says_so(tmp_path: Path) -> None:
    files = files_of(sample_record())
    manifest = json.loads(files["manifest.json"]) | {"version": 2}
    files["manifest.json"] = json.dumps(manifest).encode()
    write_bundle(sample_record(), tmp_path / "out")
    (tmp_path / "out" / "manifest.json").write_bytes(sealed(files)["manifest.json"])
    with pytest.raises(FileInputError, match="must be of tsis-bundle 1; got 'tsis-bundle' 2"):
        read_bundle(tmp_path / "out")
