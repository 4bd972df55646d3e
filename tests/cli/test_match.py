from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching.trials import generated_trials
from matplotlib.figure import Figure
from PIL import Image

from tsis.matching import register
from tsis.matching.methods import UNMATCHED
from tsis.matching.point_files import read_points
from tsis.present.matching import draw_poses, draw_registration

if TYPE_CHECKING:
    from pathlib import Path

    from benchmarks.matching.distort import Trial
    from tests.cli.conftest import RunTsis


def words(text: str) -> str:
    return " ".join(text.split())


@pytest.fixture
def pair(tmp_path: Path) -> Trial:
    """Two files of a mild deformation with a few points that have no partner."""
    (trial,) = generated_trials(shape="strokes", family="deformation", level=1, count=1, points=60)
    np.savetxt(tmp_path / "a.csv", trial.source, delimiter=",")
    np.save(tmp_path / "b.npy", trial.target)
    return trial


def test_two_files_are_matched_shown_and_written(run_tsis: RunTsis, pair: Trial, tmp_path: Path) -> None:
    finished = run_tsis("match", "a.csv", "b.npy", "--method", "cpd", "--out", "moved.csv", "--figure", "match.png")
    assert finished.code == 0
    assert "a.csv (60 points) to b.npy (60 points)" in words(finished.out)
    assert "Research use only" in finished.out
    assert (tmp_path / "match.png").read_bytes().startswith(b"\x89PNG")
    moved = read_points(tmp_path / "moved.csv")
    assert np.sqrt(((moved - pair.target[pair.truth]) ** 2).sum(axis=1).mean()) < 0.05
    columns = np.genfromtxt(tmp_path / "moved.csv", delimiter=",", names=True)
    matched = columns["match"].astype(int)
    assert (matched == pair.truth)[matched != UNMATCHED].mean() > 0.8
    assert ((columns["trust"] >= 0) & (columns["trust"] <= 1)).all()


def test_json_is_the_whole_result(run_tsis: RunTsis, pair: Trial) -> None:
    finished = run_tsis("match", "--json", "--method", "cpd", "a.csv", "b.npy")
    found = json.loads(finished.out)
    assert found["command"] == "match"
    assert found["source"] == {"name": "a.csv", "points": 60}
    assert np.shape(found["moved"]) == pair.source.shape
    assert found["matched"] == sum(match != UNMATCHED for match in found["matches"])
    assert found["rms_after"] < 0.05 < found["rms_before"]
    assert 0 <= found["confidence"] <= 1


def test_the_page_shows_sets_grid_and_poses(run_tsis: RunTsis, pair: Trial, tmp_path: Path) -> None:
    finished = run_tsis("match", "a.csv", "b.npy", "--html", "match.html", "--json")
    found = json.loads(finished.out)
    page = (tmp_path / "match.html").read_text()
    assert found["html"] == "match.html"
    assert page.count("<img") == 2
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "Poses that the data allow" in page
    assert f"{found['alternatives'][0]['probability']:.4g}" in page
    assert titles_of(tmp_path, "a.csv", "b.npy")[:2] == ["before, with the matches", "after tprl"]
    assert f"{found['confidence']:.4f}" in page


def titles_of(folder: Path, source: str, target: str) -> list[str]:
    """Titles of the panels that a person sees."""
    first, second = read_points(folder / source), read_points(folder / target)
    registration, figure = register(first, second), Figure(figsize=(8.0, 4.0))
    parts = figure.subfigures(2, 1, squeeze=False)[:, 0]
    shown = registration.untrusted if registration.reliable else None
    draw_registration(parts[0], first, second, registration, shown)
    draw_poses(parts[1], second, registration.alternatives)
    return [ax.get_title() for part in parts for ax in part.axes]


def test_a_symmetric_shape_is_withheld_with_its_poses(run_tsis: RunTsis, tmp_path: Path) -> None:
    angle = 2 * np.pi * np.arange(60) / 60
    shape = (1 + 0.2 * np.cos(3 * angle))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    for name in ("a", "b"):
        np.save(tmp_path / f"{name}.npy", shape)
    finished = run_tsis("match", "a.npy", "b.npy", "--html", "match.html", "--figure", "match.png", "--json")
    found = json.loads(finished.out)
    assert not found["reliable"]
    assert finished.code == 3
    assert [found[name] for name in ("matched", "matches", "moved", "trust", "rms_after")] == [None] * 5
    assert found["flags"] == ["several_poses"]
    assert len(found["alternatives"]) >= 3
    assert all(set(pose) == {"rotation_deg", "probability"} for pose in found["alternatives"])
    page = (tmp_path / "match.html").read_text()
    assert "not reliable" in page
    assert "state the expected rotation" in page
    titles = titles_of(tmp_path, "a.npy", "b.npy")
    assert titles[0] == f"no reliable match: confidence {found['confidence']:.3f}"
    assert all("probability" in title for title in titles[1:])


def test_a_withheld_match_is_given_only_when_asked_for(run_tsis: RunTsis, tmp_path: Path) -> None:
    angle = 2 * np.pi * np.arange(60) / 60
    np.save(tmp_path / "a.npy", np.column_stack([np.cos(angle), np.sin(angle)]))
    arguments = ("match", "a.npy", "a.npy", "--out", "moved.csv")
    withheld = run_tsis(*arguments)
    assert withheld.code == 3
    assert "withheld" in withheld.out
    assert "Written" not in withheld.out
    assert not (tmp_path / "moved.csv").exists()
    given = run_tsis(*arguments, "--untrusted", "--json")
    assert given.code == 3
    found = json.loads(given.out)
    assert not found["reliable"]
    assert len(found["moved"]) == 60
    np.testing.assert_allclose(read_points(tmp_path / "moved.csv"), found["moved"])


def test_contours_of_images_are_matched(run_tsis: RunTsis, tmp_path: Path) -> None:
    rows, columns = np.mgrid[:120, :160]
    for name, middle in (("a", 70), ("b", 82)):
        away = np.hypot(columns - middle, 1.4 * (rows - 60))
        angle = np.arctan2(1.4 * (rows - 60), columns - middle)
        inside = away < 35 * (1 + 0.25 * np.cos(angle) + 0.2 * np.sin(2 * angle))
        Image.fromarray(np.where(inside, 200, 20).astype(np.uint8)).save(tmp_path / f"{name}.png")
    found = json.loads(run_tsis("match", "a.png", "b.png", "--json").out)
    assert found["source"]["points"] == found["target"]["points"] == 100
    assert found["reliable"]
    shift = np.array(found["moved"]) - read_points(tmp_path / "a.png")
    np.testing.assert_allclose(shift, np.tile([12.0, 0.0], (100, 1)), atol=1.0)
    Image.fromarray(np.full((20, 30), 7, dtype=np.uint8)).save(tmp_path / "flat.png")
    assert "must show a contour" in words(run_tsis("match", "flat.png", "b.png").err)


def test_points_of_space_and_another_format(run_tsis: RunTsis, tmp_path: Path) -> None:
    (trial,) = generated_trials(shape="surface", family="deformation", level=1, count=1, points=60)
    head = "\n".join(["ply", "format ascii 1.0", "element vertex 60", *(f"property double {axis}" for axis in "xyz")])
    rows = "\n".join(" ".join(map(repr, row)) for row in trial.source.tolist())
    (tmp_path / "a.ply").write_text(f"{head}\nend_header\n{rows}\n")
    np.save(tmp_path / "b.npy", trial.target)
    finished = run_tsis("match", "a.ply", "b.npy", "--method", "cpd", "--figure", "match.png")
    assert finished.code == 0
    assert (tmp_path / "match.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("a.csv",), "Missing argument 'B'"),
        (("a.csv", "nowhere.csv"), "'nowhere.csv' does not exist"),
        (("a.csv", "space.csv"), "2 coordinates in 'a.csv' and 3 in 'space.csv'"),
        (("a.csv", "bad.csv"), "'bad.csv': line 2 must hold finite numbers; got 'nan'"),
        (("a.csv", "b.npy", "--out", "a.csv"), "must be new"),
        (("a.csv", "b.npy", "--figure", "a.csv"), "must be new"),
        (("a.csv", "b.npy", "--method", "cdp"), "did you mean 'cpd'"),
        (("a.csv", "b.npy", "--method", "cpd", "--out", "none/moved.csv"), "must be writable"),
        (("a.csv", "b.npy", "--seed", "-1"), "--seed"),
        (("a.csv", "b.npy", "--html", "a.csv"), "must be new"),
        (("a.csv", "b.npy", "--html", "x", "--figure", "x"), "--figure and --html must be two files"),
        (("a.csv", "one.csv"), "target must hold at least 4 distinct points; got 1"),
        (("a.csv", "equal.csv"), "target must hold at least 4 distinct points; got 1"),
        (("line.csv", "a.csv"), "source must not lie in a line; got 5 points that do"),
        (("a.csv", "empty.csv"), "'empty.csv' must hold data; got an empty file"),
        (("a.csv", "mixed.csv"), "line 2 must have 2 columns as the first one; got 3"),
        (("a.csv", "words.csv"), "line 2 must hold finite numbers"),
        (("million.npy", "a.csv"), "at most 200000 points; got 1000000 (thin them out)"),
    ],
)
def test_bad_input_is_one_sentence(
    run_tsis: RunTsis, pair: Trial, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / "space.csv").write_text("1,2,3\n4,5,6\n")
    (tmp_path / "bad.csv").write_text("1,2\n3,nan\n")
    (tmp_path / "one.csv").write_text("1,2\n")
    (tmp_path / "equal.csv").write_text("1,2\n" * 9)
    (tmp_path / "line.csv").write_text("1,2\n2,3\n3,4\n4,5\n5,6\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "mixed.csv").write_text("1,2\n1,2,3\n")
    (tmp_path / "words.csv").write_text("1,2\nthree,4\n")
    np.save(tmp_path / "million.npy", np.zeros((1_000_000, 2)))
    before = sorted(path.name for path in tmp_path.iterdir())
    finished = run_tsis("match", *arguments)
    assert finished.code == 2
    assert finished.err.startswith("Error: ")
    assert message in words(finished.err)
    assert finished.err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_help_ends_with_an_example(run_tsis: RunTsis) -> None:
    assert "Example: tsis match before.csv after.ply" in words(run_tsis("match", "--help").out)
