"""What the values files say is found again, and differs from the printed values only within bounds or for reasons."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from studies.gallery import SHOWN
from studies.shown import VALUES, Shown, Value, read_values

from studies import gallery, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

ROOT = Path(__file__).parents[2]
QUICK = {"table-2-1", "figure-3-9", "figure-3-10", "figure-5-19", "figure-6-23"}
RUNS = [pytest.param(each, id=each.name, marks=() if each.name in QUICK else pytest.mark.slow) for each in SHOWN]


@cache
def _result(run: Callable[[np.random.Generator], Any]) -> Any:
    return run(np.random.default_rng(gallery.SEED))


def test_every_figure_and_table_has_one_values_file() -> None:
    names = [each.name for each in SHOWN]
    assert len(set(names)) == len(names)
    assert sorted(path.stem for path in VALUES.glob("*.json")) == sorted(names)


@pytest.mark.parametrize("each", RUNS)
def test_a_run_finds_what_the_values_file_says(each: Shown) -> None:
    if each.absent():
        pytest.skip(each.absent())
    result = _result(each.short or each.run)
    fresh = each.values(result)
    assert fresh, "a short run must find some of the quantities"
    assert read_values(each.name).differing(fresh) == []
    if each.short is None:
        assert set(fresh) == {value.quantity for value in read_values(each.name).values}
    if each.draw is not None:
        figure = Figure()
        each.draw(result, figure)
        assert figure.axes
        assert all(axis.get_xlabel() or axis.get_ylabel() or axis.get_title() for axis in figure.axes)


@pytest.mark.parametrize("each", SHOWN, ids=lambda each: each.name)
def test_the_page_shows_it(each: Shown) -> None:
    beside = read_values(each.name)
    text = gallery.page(ROOT)
    assert text.count(f"## {beside.title}\n") == 1
    for value in beside.values:
        assert f"| {value.quantity} |" in text
    assert (each.draw is not None) == (gallery.PICTURES / f"{each.name}.png").is_file()
    assert (f"{each.name}.png" in text) == (each.draw is not None)


def test_a_difference_needs_a_reason() -> None:
    given: dict[str, Any] = {"quantity": "slope", "unit": "", "printed": 1.0, "ours": 1.2, "repeats_within": 0.0}
    with pytest.raises(ValueError, match="needs a tolerance, or a reason"):
        Value(**given)
    with pytest.raises(ValueError, match=r"'slope' must lie within 0\.1 of the printed 1; got 1\.2: say why"):
        Value(**given, tolerance=0.1)
    assert Value(**given, reason="another probe").reason
    assert Value(**given | {"tolerance": 0.3}).tolerance == 0.3
    assert Value(**given | {"printed": None}).printed is None
    with pytest.raises(ValueError, match="must be finite"):
        Value(**given | {"ours": float("nan")}, reason="another probe")


@pytest.mark.parametrize("found", [0.123456789, 1.0000049, 987654.3, -2.0e-9 / 3.0])
def test_a_kept_number_is_found_again_though_it_was_rounded(
    found: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    value = {"quantity": "a", "unit": "", "printed": None, "ours": 1.0, "repeats_within": 0.0}
    kept = {"title": "Figure 0", "section": "0", "says": "", "found": "", "values": [value]}
    (tmp_path / "figure-0.json").write_text(json.dumps(kept))
    monkeypatch.setattr(shown, "VALUES", tmp_path)
    one = Shown(name="figure-0", run=lambda rng: rng, values=lambda _: {"a": found})
    assert gallery.make([one], write=True) == []
    assert not read_values("figure-0").values[0].repeats(1.0001 * found)


def test_what_a_run_no_longer_finds_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = {
        "title": "Figure 0", "section": "0", "says": "", "found": "",
        "values": [
            {"quantity": name, "unit": "", "printed": None, "ours": 1.0, "repeats_within": 0.1} for name in ("a", "b")
        ],
    }  # fmt: skip
    (tmp_path / "figure-0.json").write_text(json.dumps(kept))
    monkeypatch.setattr(shown, "VALUES", tmp_path)
    one = Shown(name="figure-0", run=lambda rng: rng, values=lambda _: {"a": 1.05, "c": 2.0})
    assert gallery.make([one]) == ["figure-0: c is in no values file", "figure-0: b was not found"]
    moved = Shown(name="figure-0", run=lambda rng: rng, values=lambda _: {"a": 1.2, "b": 0.95})
    assert gallery.make([moved]) == ["figure-0: a is 1.2 now and was 1 ± 0.1"]
    assert gallery.make([moved], write=True) == []
    assert [value.ours for value in read_values("figure-0").values] == [1.2, 0.95]


def test_what_needs_a_missing_file_says_so(tmp_path: Path) -> None:
    here = Shown(name="figure-0", run=lambda rng: rng, values=lambda _: {}, needs=tmp_path / "points.npz")
    assert here.absent().startswith("figure-0 needs points.npz")
    (tmp_path / "points.npz").touch()
    assert here.absent() == ""


def drawn(rng: np.random.Generator) -> Mapping[str, float]:
    return {"a": float(rng.normal()), "b": 2.0}


def drawn_short(rng: np.random.Generator) -> Mapping[str, float]:
    return {"a": 10.0 + float(rng.normal())}


def test_each_seed_has_a_value_and_the_short_run_the_last() -> None:
    steps: list[tuple[int, int]] = []
    shown = Shown(name="figure-0", run=drawn, short=drawn_short, values=lambda found: found)
    found = gallery.scatter([shown], 3, progress=lambda *step: steps.append(step))["figure-0"]
    first = float(np.random.default_rng(1).normal())
    assert found["a"][0] == first
    assert found["a"][-1] == 10.0 + first
    assert len(set(found["a"])) == 4
    assert found["b"][:3] == [2.0, 2.0, 2.0]
    assert math.isnan(found["b"][-1])
    assert steps == [(turn, 4) for turn in range(4)]
