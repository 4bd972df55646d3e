"""Folders of ``tsis demo`` are believed only as far as their hashes go."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import cv2
import pytest
from tests.records.importing.result_folder import levels, make_demo, write

from tsis.errors import FileInputError, InputError
from tsis.records.importing import import_batches
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def demo(tmp_path: Path) -> Path:
    return make_demo(tmp_path / "tsis-demo")


def changed(folder: Path, *place: str | int, to: Any) -> None:
    document = json.loads((folder / "result.json").read_text())
    inner = document
    for step in place[:-1]:
        inner = inner[step]
    if to is ...:
        del inner[place[-1]]
    else:
        inner[place[-1]] = to
    write(folder, document)


PROVENANCE = ("estimate", "provenance")


def test_presses_get_their_roles_and_the_phantom_its_truth(demo: Path) -> None:
    (found,) = find_import_batches([demo], ImportOptions())
    roles = [(press.name, press.role) for press in found.presses]
    assert roles == [
        ("target-0.5N.png", "target"),
        ("target-1N.png", "target"),
        ("reference-1N.png", "plain"),
        ("untouched.png", "untouched"),
    ]
    assert (found.name, found.truth) == ("size-8", {"diameter_mm": 8.0, "depth_mm": 5.0, "young_kpa": 80.0})
    assert found.estimate is not None
    assert found.estimate.probe == "tsis-domed"
    taken = [press.taken for press in found.presses]
    assert taken == sorted(set(taken))


def test_plain_tissue_has_no_truth(demo: Path) -> None:
    changed(demo, "simulated", "phantom", "inclusion", to=None)
    (found,) = find_import_batches([demo], ImportOptions())
    assert found.truth == {}


def test_a_frame_that_is_not_the_estimated_one_is_refused(demo: Path) -> None:
    cv2.imwrite(str(demo / "target-1N.png"), levels(7))
    with pytest.raises(FileInputError, match=r"target-1N\.png.*must be the frame that was estimated"):
        find_import_batches([demo], ImportOptions())


def test_virtual_presses_stay_out_of_a_store_of_subjects(demo: Path, tmp_path: Path) -> None:
    with (
        open_store(tmp_path / "subjects", kind="subject") as store,
        pytest.raises(InputError, match="must go into a store of phantoms"),
    ):
        import_batches(store, find_import_batches([demo], ImportOptions()))


def test_the_folder_of_another_command_says_what_to_do(demo: Path) -> None:
    changed(demo, "command", to="examine")
    with pytest.raises(FileInputError, match="repeat the command with --save"):
        find_import_batches([demo], ImportOptions())


@pytest.mark.parametrize(
    ("place", "to", "sentence"),
    [
        (("command",), ..., "must be of tsis demo"),
        (("estimate",), ..., "it holds no 'estimate'"),
        (("estimate",), None, "must be as tsis demo wrote it"),
        (("simulated", "phantom"), [], "must be as tsis demo wrote it"),
        (("simulated", "phantom", "inclusion", "depth_mm"), "deep", "inclusion.depth_mm must be a number"),
        ((*PROVENANCE, "images"), [], "must tell of a press on the phantom"),
        ((*PROVENANCE, "images", 0, "name"), "../../etc/passwd", "must name files of its own"),
        ((*PROVENANCE, "images", 0, "name"), "absent.png", "does not exist"),
        ((*PROVENANCE, "images", 0, "force_n"), -3.0, "force_n must lie in"),
        ((*PROVENANCE, "images", 0, "mm_per_pixel"), [0.0, 0.1], "mm_per_pixel must lie in"),
        ((*PROVENANCE, "images", 0, "settings"), "x", "must be as tsis demo wrote it"),
        ((*PROVENANCE, "probe", "name"), "tsis-dommed", "did you mean 'tsis-domed'"),
        ((*PROVENANCE, "prior", "depth_mm"), [12.0, 4.0], "the high end of depth_mm"),
        ((*PROVENANCE, "prior"), None, "must be as tsis demo wrote it"),
    ],
)
def test_a_result_that_tells_nonsense_is_refused(
    demo: Path, place: tuple[str | int, ...], to: Any, sentence: str
) -> None:
    changed(demo, *place, to=to)
    with pytest.raises(ValueError, match=sentence) as refused:
        find_import_batches([demo], ImportOptions())
    assert "\n" not in str(refused.value)


def test_a_changed_calibration_is_refused(demo: Path) -> None:
    content = (demo / "calibration.json").read_text()
    (demo / "calibration.json").write_text(content.replace("2.0", "3.0", 1))
    with pytest.raises(Exception, match="does not match its hash"):
        find_import_batches([demo], ImportOptions())
