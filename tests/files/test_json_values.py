from __future__ import annotations

import base64
import hashlib
import json
import math
import zlib
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tsis.errors import InputError
from tsis.files.canonical_json import canonical, content_sha256, json_bytes
from tsis.files.json_values import from_json_value, to_json_value

if TYPE_CHECKING:
    from collections.abc import Mapping

LEAVES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text("aä€")
VALUES = st.recursive(LEAVES, lambda inner: st.lists(inner) | st.dictionaries(st.text("aä€"), inner), max_leaves=8)


@given(value=VALUES)
def test_the_hash_is_that_of_sorted_json(value: Any) -> None:
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    assert content_sha256(value) == hashlib.sha256(text.encode()).hexdigest()


def test_json_of_a_file_has_no_nan_and_no_unknown_objects() -> None:
    document = {"a": np.arange(2), "b": np.float32(0.5), "c": MappingProxyType({}), "d": Path("x"), "e": Part(1.0)}
    assert json.loads(json_bytes(document)) == {"a": [0, 1], "b": 0.5, "c": {}, "d": "x", "e": {"length_mm": 1.0}}
    for wrong in (math.nan, object()):
        with pytest.raises((ValueError, TypeError)):
            json_bytes({"a": wrong})


@dataclass(frozen=True, slots=True)
class Part:
    length_mm: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whole:
    name: str
    count: int
    sure: bool
    made: datetime
    parts: tuple[Part, ...]
    size_mm: tuple[float, float]
    map: NDArray[np.float64]
    limits: Mapping[str, float]
    settings: Mapping[str, Any]
    sd: float | None = None


ARRAY: Any = NDArray[np.float64]
WHOLE = Whole(
    name="a",
    count=3,
    sure=True,
    made=datetime(2026, 1, 2, tzinfo=UTC),
    parts=(Part(1.5),),
    size_mm=(1.0, math.inf),
    map=np.arange(100.0),
    limits=MappingProxyType({"low": -math.inf}),
    settings=MappingProxyType({"gain": math.nan, "roi": (0, 8)}),
)


def test_every_declared_type_comes_back_through_json() -> None:
    back = from_json_value(Whole, json.loads(json_bytes(to_json_value(WHOLE))), "whole")
    assert (back.name, back.count, back.sure, back.made, back.sd) == ("a", 3, True, WHOLE.made, None)
    assert (back.parts, back.size_mm, dict(back.limits)) == (WHOLE.parts, WHOLE.size_mm, dict(WHOLE.limits))
    assert back.map.tobytes() == WHOLE.map.tobytes()
    assert math.isnan(back.settings["gain"])
    assert back.settings["roi"] == [0, 8]
    assert set(to_json_value(WHOLE, pack=False)["map"]) == {"shape", "kind", "sha256"}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"name": 3}, "whole.name must be text; got 3"),
        ({"count": 3.0}, "whole.count must be a whole number"),
        ({"count": 2**63}, "whole.count must be a whole number of at most 64 bits"),
        ({"sure": 1}, "whole.sure must be true or false; got 1"),
        ({"made": 0}, "whole.made must be a date and time"),
        ({"parts": "abc"}, "whole.parts must be a list; got 'abc'"),
        ({"parts": [{"length_mm": "1"}]}, r"whole.parts\[0\].length_mm must be a number; got '1'"),
        ({"parts": [1]}, r"whole.parts\[0\] must be an object with named values; got 1"),
        ({"parts": [{}]}, r"whole.parts\[0\] must hold all of its values; missing \['length_mm'\]"),
        ({"size_mm": [1.0]}, r"whole.size_mm must be a list of 2; got \[1.0\]"),
        ({"map": [[1], [1, 2]]}, "whole.map must be an array of numbers"),
        ({"limits": {"low": True}}, "whole.limits.low must be a number; got True"),
        ({"limits": []}, r"whole.limits must be a mapping; got \[\]"),
        ({"settings": {"a": [{"$number": "x"}]}}, r"whole.settings.a\[0\] must hold a number as"),
        ({"sd": 10**400}, "whole.sd must be a finite number; got a number of 1329 bits"),
        ({"more": 1, "extra": 2}, r"whole must hold only known values; got \['extra', 'more'\]"),
    ],
)
def test_an_error_names_the_value_its_requirement_and_what_came(change: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=f"^{says}"):
        from_json_value(Whole, to_json_value(WHOLE) | change, "whole")


@pytest.mark.parametrize("level", [0, 1, 9])
def test_arrays_of_any_packing_unpack_to_exactly_what_they_declare(level: int) -> None:
    values = np.random.default_rng(5).integers(0, 9, 50_000) / 8
    packed = to_json_value(replace(WHOLE, map=values))["map"]
    content = zlib.decompress(base64.b64decode(packed["zlib"]))
    whole = base64.b64encode(zlib.compress(content, level)).decode()
    assert from_json_value(ARRAY, packed | {"zlib": whole}, "map").tobytes() == values.tobytes()
    half = base64.b64encode(zlib.compress(content, level)[:-5]).decode()
    for count, each in ((49_999, whole), (50_001, whole), (50_000, half)):
        with pytest.raises(InputError, match=f"^map must be a whole map of {4 * count} bytes"):
            from_json_value(ARRAY, packed | {"shape": [count], "zlib": each}, "map")


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@given(values=st.lists(NUMBERS, max_size=3).map(np.array) | st.lists(NUMBERS, min_size=65, max_size=70).map(np.array))
def test_arrays_come_back_bit_for_bit(values: NDArray[np.float64]) -> None:
    back = from_json_value(Whole, json.loads(json_bytes(to_json_value(replace(WHOLE, map=values)))), "whole")
    assert back.map.tobytes() == values.tobytes()


@pytest.mark.parametrize("number", [math.nan, math.inf])
@pytest.mark.parametrize("size", [3, 100])
def test_arrays_that_are_not_finite_are_refused_both_ways(number: float, size: int) -> None:
    with pytest.raises(InputError, match=r"^map must be an array of finite numbers"):
        to_json_value(replace(WHOLE, map=np.full(size, number)))
    content = np.full(100, number, "<f4").tobytes()
    packed = {"shape": [100], "kind": "single", "sha256": hashlib.sha256(content).hexdigest()}
    packed["zlib"] = base64.b64encode(zlib.compress(content)).decode()
    with pytest.raises(InputError, match=r"^map must be an array of finite numbers"):
        from_json_value(ARRAY, [number] * size if size < 64 else packed, "map")


@dataclass(frozen=True)
class Outer:
    inner: tuple[Whole, ...]


def test_a_number_that_json_lacks_is_refused_by_its_name_at_any_depth() -> None:
    with pytest.raises(InputError, match=r"^sd must be a number; got NaN"):
        to_json_value(Outer((WHOLE, replace(WHOLE, sd=math.nan))))


def test_a_name_of_a_file_that_is_not_utf_8_comes_back() -> None:
    name = "half \ud800"
    document = json.loads(canonical(to_json_value(replace(WHOLE, name=name, settings={}))))
    assert from_json_value(Whole, document, "whole").name == name


def test_complete_values_have_their_defaults_too() -> None:
    plain = to_json_value(WHOLE, without=("sd",))
    assert from_json_value(Whole, plain, "whole").sd is None
    with pytest.raises(InputError, match=r"missing \['sd'\]"):
        from_json_value(Whole, plain, "whole", complete=True)
