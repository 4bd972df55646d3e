from __future__ import annotations

import io
import json
import shutil
import sys
from contextlib import redirect_stdout
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching import DATA
from matplotlib.figure import Figure
from PIL import Image

from tsis.cli import main
from tsis.matching import UNMATCHED, read_points, register
from tsis.matching.trials import read_trial_rows
from tsis.matching.trials._trials import generated_trials
from tsis.present.matching import draw_poses, draw_registration

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

    from tsis.matching.trials import Trial


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
    assert json.loads(run_tsis("match", "points", "a.csv", "b.npy", "--method", "cpd", "--json").out) == found


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
    draw_registration(parts[0], first, second, registration)
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
    assert found["matched"] == 0
    assert len(found["alternatives"]) >= 3
    assert "not reliable" in (tmp_path / "match.html").read_text()
    titles = titles_of(tmp_path, "a.npy", "b.npy")
    assert titles[:2] == ["no reliable match", f"not moved: confidence {found['confidence']:.3f}"]
    assert all("probability" in title for title in titles[2:])


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


def test_a_file_called_as_a_command_is_named_by_its_folder(run_tsis: RunTsis, pair: Trial, tmp_path: Path) -> None:
    (tmp_path / "a.csv").rename(tmp_path / "bench")
    assert "bench (60 points)" in run_tsis("match", "./bench", "b.npy", "--method", "cpd").out


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


def test_help_of_all_three_ends_with_examples(run_tsis: RunTsis) -> None:
    assert "Example: tsis match before.csv after.csv" in words(run_tsis("match", "--help").out)
    assert words(run_tsis("match").out) == words(run_tsis("match", "-h").out)
    assert "Example: tsis match before.csv after.ply" in words(run_tsis("match", "points", "--help").out)
    assert "Example: tsis match bench" in words(run_tsis("match", "bench", "--help").out)


BENCH = ("match", "bench", "--methods", "cpd,shape-context", "--levels", "1", "--families", "noise,outliers")


@pytest.fixture(scope="module")
def benched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of a finished benchmark on generated shapes, and what it printed."""
    folder = tmp_path_factory.mktemp("benched")
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed):
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["tsis", *BENCH, "--trials", "1", "--out", "bench"])
        with pytest.raises(SystemExit) as stop:
            main()
    assert not stop.value.code
    return folder / "bench", printed.getvalue()


@pytest.mark.slow
def test_bench_on_generated_shapes(benched: tuple[Path, str]) -> None:
    folder, printed = benched
    assert "noise: 2 trials" in words(printed)
    assert "1.00 [1.00, 1.00]" in printed  # cpd is the best of itself
    assert "Research use only" in printed
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["noise.png", "outliers.png", "result.json", "rows.csv", "summary.csv"]
    result = json.loads((folder / "result.json").read_text())
    assert len(result["pooled"]) == 4
    assert len(result["levels"]) == 2 * 2 * 2
    rows = read_trial_rows(folder / "rows.csv")
    assert len(rows) == 2 * 2 * 2
    means = {(each["group"], each["method"]): each["mean"] for each in result["pooled"]}
    errors = [row.error for row in rows if row.group.endswith("/noise") and row.method == "cpd"]
    assert means["noise", "cpd"] == pytest.approx(np.mean(errors))


def test_bench_goes_on_where_it_was_interrupted(
    run_tsis: RunTsis, benched: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tsis.cli.match._bench._figure", lambda *_: Figure())  # drawn in the test above
    shutil.copytree(benched[0], tmp_path / "bench")
    file = tmp_path / "bench" / "rows.csv"
    whole = file.read_text().splitlines(keepends=True)
    file.write_text("".join(whole[:6]) + whole[6][:10])
    assert "must be new" in run_tsis(*BENCH, "--trials", "1", "--out", "bench").err
    assert run_tsis(*BENCH, "--trials", "1", "--out", "bench", "--resume").code == 0
    again = file.read_text().splitlines(keepends=True)
    assert again[:6] == whole[:6]
    assert [line.rsplit(",", 3)[0] for line in again] == [line.rsplit(",", 3)[0] for line in whole]


def test_an_interrupted_bench_says_how_to_go_on(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tsis.matching.trials._runs.evaluate_trial", interrupted)
    finished = run_tsis(*BENCH, "--out", "bench")
    assert finished.code == 130
    assert "Resume with: tsis match bench" in finished.err
    assert finished.err.endswith("--out bench --resume\n")  # as one types it


def test_absent_libraries_are_named(run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "tsis.matching.trials._methods.Peer.absent", lambda self: f"{self.library} is not installed", raising=True
    )
    finished = run_tsis("match", "bench", "--methods", "cpd,pycpd,pycpd-raw,probreg", "--levels", "1", "--trials", "1")
    assert "pycpd is not installed; left out: pycpd, pycpd-raw." in words(finished.out)
    assert "probreg is not installed; left out: probreg." in words(finished.out)
    assert "must name one that can run here" in run_tsis("match", "bench", "--methods", "pycpd").err


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the public trials are not on this machine")
def test_bench_on_public_trials_and_the_hotel(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis(
        *("match", "bench", "--data", DATA, "--families", "noise,hotel", "--levels", "1", "--trials", "1"),
        *("--methods", "cpd", "--out", "bench", "--json"),
    )
    found = json.loads(finished.out)
    assert {each["group"] for each in found["pooled"]} == {
        "noise",
        *(f"hidden {share}" for share in (0, 0.1, 0.2, 0.3)),
    }
    assert (tmp_path / "bench" / "hotel.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--levels", "9"), r"level must lie in [1, 6]; got 9"),
        (("--levels", "1;2"), "whole numbers with commas"),
        (("--families", "nois"), "did you mean 'noise'"),
        (("--families", "hotel"), "needs --data"),
        (("--methods", "tprll"), "did you mean 'tprl'"),
        (("--shapes", "fish"), "no shape is called 'fish'"),
        (("--data", "nowhere"), "does not exist; check the name and the folder"),
        (("--resume",), "--resume needs --out"),
        (("--trials", "0"), "--trials"),
    ],
)
def test_bad_orders_to_bench_are_one_sentence(run_tsis: RunTsis, arguments: tuple[str, ...], message: str) -> None:
    finished = run_tsis("match", "bench", *arguments)
    assert finished.code == 2
    assert message in words(finished.err)
    assert finished.err.count("\n") == 1
