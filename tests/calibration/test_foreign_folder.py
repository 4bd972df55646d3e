"""Folders of other programs become session folders, whose frames have the forces that tables and names tell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.calibration.foreign_folder import guess_session, write_session
from tsis.calibration.frames import load_frames
from tsis.catalog.probes import load_probe
from tsis.errors import FileInputError
from tsis.files.images import encode_picture

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rng = np.random.default_rng(3)
    for name in ("a.png", "b.png", "ref.png"):
        (tmp_path / name).write_bytes(encode_picture(rng.integers(40, 200, (48, 64)).astype(np.uint8)))
    return tmp_path


@pytest.mark.parametrize(
    ("table", "encoding"),
    [
        ("file,force_n\nb.png,0.5\na.png,0.25\n", "utf-8"),
        ("Bild\nImage;Force / mN\nframes\\a;250,0\nframes\\b;500,0\n", "utf-16"),
        ("No.\tLoad (N)\n1\t0.25\n2\t0.5\n", "utf-8"),
    ],
)
def test_a_table_gives_the_forces_and_the_frames_are_read(folder: Path, table: str, encoding: str) -> None:
    (folder / "forces.csv").write_bytes(table.encode(encoding))
    (folder / "notes.txt").write_text("taken on a Monday\n")
    guessed = guess_session(folder)
    assert [(frame.file, frame.role, frame.force_n) for frame in guessed] == [
        ("a.png", "target", 0.25),
        ("b.png", "target", 0.5),
        ("ref.png", "untouched", 0.0),
    ]
    write_session(folder, guessed, mm_per_pixel=(0.05, 0.06))
    frames = load_frames(folder, probe=load_probe("tsis-2011"))
    assert [image.force_n for image in frames.images] == [0.25, 0.5]
    assert frames.images[0].mm_per_pixel == (0.05, 0.06)
    assert len(frames.untouched) == 1
    with pytest.raises(FileInputError, match="session folder already"):
        guess_session(folder)


@pytest.mark.parametrize(
    ("table", "names"),
    [
        ("Bild;Kraft (mN);Art\na.png;250;Ziel\nb.png;250;Referenz\nref.png;0;leer\n", "abref"),
        ("file,force_n,role\na.png,0.25,target\nb.png,0.25,plain\nref.png,0,untouched\n", "abref"),
        ("file,force_n,kind\na.png,0.25,lump\nb.png,0.25,no lump\nref.png,0,blank\n", "abref"),
        ("file,force_n\nlump.png,0.25\nreference-1.png,0.25\nref.png,0\n", "renamed"),
    ],
)
def test_a_column_or_the_names_tell_presses_of_the_reference_from_those_of_the_target(
    folder: Path, table: str, names: str
) -> None:
    if names == "renamed":
        (folder / "a.png").rename(folder / "lump.png")
        (folder / "b.png").rename(folder / "reference-1.png")
    (folder / "forces.csv").write_text(table)
    roles = {frame.file: (frame.role, frame.force_n) for frame in guess_session(folder)}
    assert roles.pop("ref.png") == ("untouched", 0.0)
    assert list(roles.values()) == [("target", 0.25), ("plain", 0.25)]


def test_a_frame_without_a_telling_name_whose_scale_shows_next_to_nothing_is_the_untouched_one(folder: Path) -> None:
    (folder / "ref.png").rename(folder / "c.png")
    (folder / "forces.csv").write_text("file;force (g)\nb.png;51\na.png;25,5\nc.png;-0,4\n")
    assert [(frame.file, frame.role) for frame in guess_session(folder)] == [
        ("a.png", "target"),
        ("b.png", "target"),
        ("c.png", "untouched"),
    ]


def test_names_and_files_beside_frames_give_forces(folder: Path) -> None:
    (folder / "a.png").rename(folder / "lump_0.75N.png")
    (folder / "b.json").write_text('{"force_n": 0.5}')
    forces = {frame.file: (frame.force_n, frame.source) for frame in guess_session(folder)}
    assert forces == {"lump_0.75N.png": (0.75, "its name"), "b.png": (0.5, "b.json"), "ref.png": (0.0, "its name")}


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"f.csv": "file,force_n\nc.png,1\na.png,1\n"}, "'c.png' is none"),
        ({"f.csv": "file,force\na.png,1\n"}, "must name its unit"),
        ({"f.csv": "force_n\n1\n"}, "have a row for each of the 3; got 1 rows"),
        ({"f.csv": "file,force_n\na.png,1\n", "g.csv": "file,force_n\na.png,1\n"}, "one table of forces"),
        ({"f.csv": "file,force_n\na.png,1\na,2\n"}, "each frame once|is none"),
    ],
)
def test_what_leaves_two_meanings_is_refused_in_a_sentence(folder: Path, tables: dict[str, str], said: str) -> None:
    for name, text in tables.items():
        (folder / name).write_text(text)
    with pytest.raises(FileInputError, match=said):
        guess_session(folder)
