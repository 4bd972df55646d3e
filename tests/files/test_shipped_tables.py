"""The tables that ship with the package are found, and are what the package computes."""

from __future__ import annotations

import sys
import tomllib
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

from release import tables
from tsis.files.cache import SHIPPED_KEYS, read_cached, read_cached_arrays, shipped_tables
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path

KINDS = tomllib.loads((shipped_tables() / SHIPPED_KEYS).read_text(encoding="utf-8"))
SHIPPED = {f"{kind}/{key}" for kind, entry in KINDS.items() for key in entry["keys"].values()}


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_a_first_answer_computes_no_table(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def solve(*_: object, **__: object) -> None:
        pytest.fail("a table is solved though it ships with the package: run `make tables`")

    def hit(kind: str, key: str) -> bytes | None:
        hits.add(f"{kind}/{key}")
        return read_cached(kind, key)

    for module in [module for name, module in sys.modules.items() if name.startswith("tsis.")]:
        for value in list(vars(module).values()):
            getattr(value, "cache_clear", lambda: None)()  # what earlier tests solved is in memory
    hits = set[str]()
    monkeypatch.setattr("tsis.files.cache.read_cached", hit)
    monkeypatch.setattr("tsis.hardness.table._solve", solve)
    monkeypatch.setattr("tsis.mechanics.surrogate.full_contact._solve", solve)
    monkeypatch.setattr("tsis.inclusion.posterior.uneven_tissue._features", solve)
    monkeypatch.setattr("tsis.mechanics.surrogate.correction_building._solve", solve)
    monkeypatch.setattr("tsis.optics.face_light._traced", solve)
    monkeypatch.setattr(tables, "VirtualProbe", partial(VirtualProbe, strain="small"))  # whose presses need no table
    asked = set(tables.compute_tables())
    assert not empty_cache.exists(), "nothing was missing, so nothing was cached"
    assert hits == SHIPPED
    assert asked >= {name for entry in KINDS.values() for name in entry["keys"]}


def test_every_shipped_table_has_a_name_and_the_key_of_its_content() -> None:
    files = {f"{path.parent.name}/{path.name}" for path in shipped_tables().glob("*/*")}
    assert files == {f"{kind}/{name}" for kind, entry in KINDS.items() for name in entry["keys"]}
    assert all(read_cached_arrays(*name.split("/")) for name in SHIPPED)
    assert {kind: entry["what"] for kind, entry in KINDS.items()} == tables.WHAT


def test_the_users_cache_comes_first(empty_cache: Path) -> None:
    kind, key = min(SHIPPED).split("/")
    shipped = read_cached_arrays(kind, key)
    assert shipped is not None
    own = empty_cache / kind / key
    own.parent.mkdir(parents=True)
    own.write_bytes(b"damaged")
    again = read_cached_arrays(kind, key)
    assert again is not None
    assert all(np.array_equal(again[name], shipped[name]) for name in shipped)


@pytest.mark.slow
def test_the_package_computes_what_it_ships(tmp_path: Path, empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = {name: read_cached_arrays(*name.split("/")) for name in SHIPPED}
    monkeypatch.setattr("tsis.files.cache.shipped_tables", lambda: tmp_path / "none")
    for _ in tables.compute_tables():
        pass
    assert {f"{path.parent.name}/{path.name}" for path in empty_cache.glob("*/*")} == SHIPPED
    for name, arrays in shipped.items():
        computed = read_cached_arrays(*name.split("/"))
        assert arrays is not None
        assert computed is not None
        # Newton's method stops elsewhere after another way to a state, and some lengths are a flat optimum of that.
        # Factors of covariances are unique up to rotations of their columns.
        learnt, factors = name.startswith("finite-strain/"), name.startswith("heterogeneity/")
        rtol, atol = (0.0, 1e-3) if learnt else (1e-5, 1e-5) if factors else (1e-6, 1e-9)
        for field in set(arrays) - ({"lengths"} if learnt else set()):
            found, shipped_part = (_covariance(each[field]) if factors else each[field] for each in (computed, arrays))
            np.testing.assert_allclose(
                found, shipped_part, rtol=rtol, atol=atol * np.abs(shipped_part).max(), err_msg=name
            )


def _covariance(factor: np.ndarray) -> np.ndarray:
    wide = factor.astype(float)
    return np.asarray(wide @ np.swapaxes(wide, -1, -2))
