"""Image files get into a store with what a person says of them."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tsis.errors import FileInputError, InputError
from tsis.records.importing import import_batches
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

WRITTEN = datetime(2026, 11, 20, 8, tzinfo=UTC)


def grey(number: int) -> NDArray[np.uint8]:
    return np.random.default_rng(number).integers(0, 256, (12, 20)).astype(np.uint8)


def image(folder: Path, number: int) -> Path:
    path = folder / f"press-{number}.png"
    cv2.imwrite(str(path), grey(number))
    os.utime(path, (WRITTEN.timestamp(), WRITTEN.timestamp()))
    return path


def test_images_come_in_with_what_was_said(tmp_path: Path) -> None:
    paths = [image(tmp_path, number) for number in range(2)]
    said = ImportOptions(role="plain", force_n=(0.5, 1.0), mm_per_pixel=(0.1, 0.2), probe="tsis-2011")
    with open_store(tmp_path / "store") as store:
        (entered,) = import_batches(store, find_import_batches(paths, said))
        for number, press in enumerate(sorted(store.presses(entered.target), key=lambda press: press.name)):
            np.testing.assert_array_equal(store.levels(press.frame), grey(number))
            assert (press.role, press.force_n, press.mm_per_pixel) == ("plain", (0.5, 1.0)[number], (0.1, 0.2))
            assert (press.name, press.probe, press.taken) == (paths[number].name, "tsis-2011", WRITTEN)
            assert len(press.settings["sha256"]) == 64


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rounds=st.lists(st.lists(st.integers(0, 5), min_size=1, max_size=8), min_size=1, max_size=4))
def test_whatever_is_imported_how_often_each_file_is_one_press(tmp_path: Path, rounds: list[list[int]]) -> None:
    folder = tmp_path / str(len(list(tmp_path.iterdir())))
    folder.mkdir()
    with open_store(folder / "store") as store:
        for numbers in rounds:
            import_batches(
                store, find_import_batches([image(folder, number) for number in numbers], ImportOptions()), target=1
            )
        names = sorted(press.name for press in store.presses(store.target(1)))
    assert names == sorted({f"press-{number}.png" for numbers in rounds for number in numbers})


def test_colours_are_refused_with_what_to_do(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "colour.png"), np.random.default_rng(1).integers(0, 256, (12, 20, 3)).astype(np.uint8))
    with pytest.raises(FileInputError, match="save it as a grey PNG file"):
        find_import_batches([tmp_path / "colour.png"], ImportOptions())


def test_grey_that_was_saved_as_colour_keeps_its_levels(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "grey.png"), np.repeat(grey(3)[..., None], 3, axis=2))
    with open_store(tmp_path / "store") as store:
        (entered,) = import_batches(store, find_import_batches([tmp_path / "grey.png"], ImportOptions()))
        np.testing.assert_array_equal(store.levels(store.presses(entered.target)[0].frame), grey(3))


def test_forces_that_fit_no_count_are_refused(tmp_path: Path) -> None:
    paths = [image(tmp_path, number) for number in range(3)]
    with pytest.raises(InputError, match="once for each of 3; got 2"):
        find_import_batches(paths, ImportOptions(force_n=(0.5, 1.0)))
    with pytest.raises(InputError, match="force_n must lie in"):
        find_import_batches(paths, ImportOptions(force_n=(1e6,)))
