"""A plan says at once what is wrong with it, and equal plans are equal documents."""

from __future__ import annotations

import json
import tomllib
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.sweep.stand_ins import QUANTITIES, small_plan

from tsis.errors import FileInputError, InputError
from tsis.sweep.plan import COLUMNS, EXAMPLE, Plan, Range, load_plan, parse_plan_text, plan_document, plan_from_document

if TYPE_CHECKING:
    from pathlib import Path


def changed(**changes: Any) -> dict[str, Any]:
    return tomllib.loads(EXAMPLE) | {"logarithmic": []} | changes


def ranges(**changes: Any) -> dict[str, Any]:
    return changed(ranges=tomllib.loads(EXAMPLE)["ranges"] | changes)


GRID = {"probe": "tsis-2011", "sample": "grid", "ranges": {"tissue_young_kpa": 5, "thickness_mm": 40}}


@pytest.mark.parametrize(
    ("document", "sentence"),
    [
        (changed(sead=1), "no key of a plan is called 'sead'; did you mean 'seed'?"),
        (changed(probe="tsis2011"), "no probe is called 'tsis2011'; did you mean 'tsis-2011'?"),
        (changed(probe={"radius_mm": 12.0}), "[probe] must give radius_mm and a list of layers"),
        (changed(probe={"radius": 1}), "did you mean 'radius_mm'?"),
        (changed(probe={"radius_mm": 12.0, "layers": [{"thickness_mm": 1}]}), "must give thickness_mm and young_kpa"),
        (changed(probe={"radius_mm": -1, "layers": [{"thickness_mm": 1, "young_kpa": 1}]}), "radius_mm must lie in"),
        ({"sample": "sobol"}, "a plan must name its probe"),
        (ranges(diamter_mm=4), "no quantity is called 'diamter_mm'; did you mean 'diameter_mm'?"),
        (ranges(diameter_mm=[12.0, 4.0]), "diameter_mm: a range must be [low, high] with low < high; got [12, 4]"),
        (ranges(diameter_mm=[1, 2, 3]), "diameter_mm must be a number or [low, high]"),
        (ranges(diameter_mm=[float("nan"), 4.0]), "diameter_mm must lie in"),
        (ranges(diameter_mm=[-1.0, 4.0]), "diameter_mm must lie in [0, 1e+06]; got -1"),
        (ranges(diameter_mm=[0.0, 4.0]), "diameter_mm must lie in [0.1, 100]; got 0"),
        (ranges(diameter_mm="wide"), "diameter_mm must be a number; got 'wide'"),
        (ranges(diameter_mm=True), "diameter_mm must be a number; got True"),
        (ranges(poisson=0.5), "poisson must lie in [0, 0.495]; got 0.5"),
        (ranges(thickness_mm=[20.0, 40.0]), "must be less than thickness_mm = 20 for every phantom; got up to 28"),
        (ranges(thickness_mm=9.0), "must be less than thickness_mm = 9 for some phantom; got at least 10"),
        (changed(ranges={"thickness_mm": [30, 40]}), "a plan must give tissue_young_kpa"),
        (
            changed(ranges={"tissue_young_kpa": 5, "thickness_mm": [30, 40], "depth_mm": 4}),
            "must give diameter_mm, you",
        ),
        (changed(count=0), "count must be a whole number in [1, 10000000]; got 0"),
        (changed(count=10**12), "count must be a whole number in [1, 10000000]"),
        (changed(count=1.5), "count must be a whole number"),
        (changed(count=2_000_000, sample="latin-hypercube"), "count must be a whole number in [1, 1000000]"),
        (changed(count=10_000_000, batch=10), "must fit into 100000 files; got 1000000 (set batch to at least 100)"),
        (changed(count=10_000_000, forces_n=[1, 2]), "at most 10000000 presses; got 10000000 phantoms x 2 forces"),
        (changed(seed=-1), "seed must be a whole number"),
        (changed(batch=10_001), "batch must be a whole number in [1, 10000]"),
        (changed(batch=6_000, forces_n=[1, 2]), "a file must hold at most 10000 presses"),
        (changed(forces_n=[]), "forces_n must be a list of 1 to 100 numbers; got 0"),
        (changed(forces_n=1.0), "forces_n must be a list of 1 to 100 numbers; got 1.0"),
        (changed(forces_n=[1.0, 1.0]), "forces_n must not repeat a value"),
        (changed(forces_n=[-1.0]), "forces_n must lie in [0, 50]; got -1"),
        (changed(strain="tiny"), "strain must be one of small, finite; got 'tiny'"),
        (changed(sample=["sobol"]), "sample must be one of sobol"),
        (changed(unfit="ignore"), "unfit must be one of refuse, keep"),
        (changed(logarithmic="depth_mm"), "logarithmic must be a list of names"),
        (changed(logarithmic=["poisson"]), "logarithmic must name ranges [low, high] of this plan; got 'poisson'"),
        (changed(ranges=3), "ranges must be a table, [ranges]; got 3"),
        (changed(grid={"depth_mm": [6.0]}), "depth_mm must stand under [ranges] or [grid]; got both"),
        (changed(grid={"inclusion_poisson": [0.3]}), "must be a number or a range when sample is 'sobol'; got a list"),
        (changed(outputs={"radii": []}), "no key of [outputs] is called 'radii'; did you mean 'radii_mm'?"),
        (changed(outputs={"radii_mm": [0.0, 13.0]}), "radii_mm must lie in [0, 12]; got 13"),
        (changed(outputs={"radii_mm": [2.0, 1.0]}), "radii_mm must ascend"),
        (changed(outputs={"columns": ["pressure"]}), "no column is called 'pressure'; did you mean 'pressure_kpa'?"),
        (changed(outputs={"columns": []}), "columns must be a list of names"),
        (GRID | {"count": 3}, "count and seed must be left out of a grid"),
        (
            GRID | {"ranges": {"tissue_young_kpa": [4, 5], "thickness_mm": 40}},
            "a grid must have numbers and lists only",
        ),
        (GRID | {"grid": {"poisson": 0.3}}, "poisson under [grid] must be a list of values; got 0.3"),
        (GRID | {"grid": {"poisson": [0.3, 0.3]}}, "poisson must not repeat a value"),
        (GRID | {"grid": {"poisson": []}}, "poisson must be a list of 1 to 10000000 numbers; got 0"),
        (GRID | {"outputs": {"columns": ["change_by_inclusion_mm"]}}, "must be left out of columns for plain tissue"),
        (changed(ranges={"tissue_young_kpa": 5, "thickness_mm": 40}), "at least one quantity must be a range"),
    ],
)
def test_a_wrong_plan_is_one_sentence(document: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        plan_from_document(document)
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_huge_grid_is_refused_before_it_is_built() -> None:
    values = [float(k) for k in range(1, 3000)]
    axes = {"diameter_mm": [0.001 * k + 1 for k in range(3000)], "depth_mm": [0.001 * k + 1 for k in range(3000)]}
    with pytest.raises(InputError, match="at most 10000000 presses; got 26991000000 phantoms"):
        plan_from_document(GRID | {"grid": {**axes, "young_kpa": values}, "batch": 10_000})


def test_unfit_phantoms_may_be_kept() -> None:
    plan = plan_from_document(ranges(thickness_mm=[20.0, 40.0]) | {"unfit": "keep"})
    assert plan.presses == 1024


def test_a_grid_has_a_phantom_for_each_combination() -> None:
    grid = {"diameter_mm": [4, 8], "depth_mm": [6, 8, 12], "young_kpa": [50, 100]}
    plan = plan_from_document(GRID | {"grid": grid, "forces_n": [0.5, 1.0]})
    assert (plan.samples, plan.presses) == (12, 24)


@given(
    count=st.integers(1, 10**6),
    seed=st.integers(0, 2**63 - 1),
    batch=st.integers(100, 10_000),
    forces=st.lists(st.floats(0.01, 50.0), min_size=1, max_size=1),
    low=st.floats(0.5, 5.0),
    width=st.floats(0.01, 5.0),
    logarithmic=st.booleans(),
    columns=st.lists(st.sampled_from(COLUMNS), min_size=1, unique=True),
)
def test_a_plan_survives_its_document(
    count: int,
    seed: int,
    batch: int,
    forces: list[float],
    low: float,
    width: float,
    logarithmic: bool,
    columns: list[str],
) -> None:
    quantities = {**QUANTITIES, "diameter_mm": Range(low=low, high=low + width, logarithmic=logarithmic)}
    plan = small_plan(
        quantities=quantities, count=count, seed=seed, batch=batch, forces_n=tuple(forces), columns=tuple(columns)
    )
    document = plan_document(plan)
    again: Plan = plan_from_document(json.loads(json.dumps(document)))
    # What was assumed, and what lights the probe, moves no number.
    assert again == replace(plan, probe=replace(plan.probe.unlit(), assumed=()))
    assert plan_document(again) == document


_KEYS = st.sampled_from(["probe", "count", "seed", "ranges", "grid", "outputs", "batch", "forces_n", "logarithmic"])
_VALUES: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["depth_mm", "layers", "radius_mm", "columns", "radii_mm"]), inner, max_size=3
        )
    ),
    max_leaves=6,
)


@given(changes=st.dictionaries(_KEYS, _VALUES, min_size=1, max_size=2))
def test_no_value_of_any_kind_breaks_the_reading_of_a_plan(changes: dict[str, Any]) -> None:
    with suppress(InputError):
        assert plan_from_document(changed(**changes)).presses >= 1


@pytest.mark.parametrize("text", ["", "probe = ", "[" * 3000, 'probe = "tsis-2011"\nprobe = 1', "\x00"])
def test_text_that_is_no_plan_is_one_sentence(text: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_plan_text(text)
    assert "\n" not in str(refused.value)


def test_files_that_are_no_plans_are_named(tmp_path: Path) -> None:
    (tmp_path / "big.toml").write_bytes(b"#" * 2**21)
    (tmp_path / "latin.toml").write_bytes("probe = 'é'".encode("latin-1"))
    for name, sentence in (("big", "at most 262144 bytes"), ("latin", "UTF-8"), ("absent", "does not exist")):
        with pytest.raises(FileInputError, match=sentence):
            load_plan(tmp_path / f"{name}.toml")
