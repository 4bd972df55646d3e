"""What a press or a target cannot be, none is; each value comes back from JSON bit for bit."""

from __future__ import annotations

import hashlib
import json
import math
import struct
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.records.sample import sample_record

from tsis.errors import FileInputError, InputError
from tsis.files.json_values import free_to_json, from_json_value, to_json_value
from tsis.model.estimate import Estimate
from tsis.records.blobs import samples_bytes, samples_of
from tsis.records.values import StoredEstimate, StoredPress, Target, estimate_from_json, estimate_to_json


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"frame": "../etc/passwd"}, "frame must be the SHA-256 of a stored file"),
        ({"frame": "0" * 64 + "\n"}, "frame must be the SHA-256 of a stored file"),
        ({"rows": 0}, r"rows must lie in \[1, 65535\]; got 0"),
        ({"columns": 2.5}, "columns must be a whole number"),
        ({"force_n": 1e9}, r"force_n must lie in \[0, 100\]"),
        ({"force_n": float("nan")}, "force_n must lie in"),
        ({"mm_per_pixel": (0.1, 40.0)}, "mm_per_pixel must lie in"),
        ({"full_scale": 0.0}, "full_scale must lie in"),
        ({"axis_px": (float("inf"), 0.0)}, "axis_px must be finite"),
    ],
)
def test_a_press_out_of_range_is_refused(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        replace(sample_record().presses[0], **values)


@pytest.mark.parametrize("name", ["", " ", "\x1b[31mred", "two\nlines", "d" * 201, 1])
def test_a_true_value_has_a_name_that_can_be_shown(name: Any) -> None:
    with pytest.raises(InputError, match="a name in truth must be 1 to 200 printable characters"):
        replace(sample_record().target, truth={name: 1.0})


def test_numbers_of_targets_end_where_names_of_folders_do() -> None:
    given = sample_record().target
    assert replace(given, number=99_999).number == 99_999
    with pytest.raises(InputError, match=r"number must lie in \[1, 99999\]; got 100000"):
        replace(given, number=100_000)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"options": {"prior": 5}}, r"options\['prior'\] must be a mapping"),
        ({"environment": {"libraries": ["numpy"]}}, r"environment\['libraries'\] must be a mapping"),
    ],
)
def test_what_recomputing_could_not_read_is_refused(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        replace(sample_record().estimates[0], **values)


def test_letters_that_join_others_may_be_in_a_name() -> None:
    family = "\U0001f468\u200d\U0001f469\u200d\U0001f467 \u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645"
    assert replace(sample_record().target, name=family).name == family


def test_half_a_letter_in_settings_is_refused() -> None:
    with pytest.raises(InputError, match=r"settings\.maker must be text that UTF-8 can hold"):
        to_json_value(replace(sample_record().presses[0], settings={"maker": "half \ud800"}))


SETTINGS = settings(max_examples=80)
WORDS = st.text(st.characters(exclude_categories=("C", "Z")), max_size=12)
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
ZONES = st.integers(-23 * 60, 23 * 60).map(lambda minutes: timezone(timedelta(minutes=minutes)))
MOMENTS = st.datetimes(datetime(1990, 1, 1), datetime(2200, 1, 1), timezones=ZONES)
LEAVES = st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | WORDS
NAMES = WORDS.filter(lambda name: name != "$number")
FREE = st.dictionaries(
    NAMES, st.recursive(LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3))
)


def through_json(plain: Any) -> Any:
    return json.loads(json.dumps(plain, allow_nan=False))


def exact(value: Any) -> Any:
    """Floats by their bits, so that 0.0 and -0.0 differ; times with the offset in which they were given."""
    if isinstance(value, float):
        return struct.pack("<d", value)
    if isinstance(value, datetime):
        return value.isoformat()
    if hasattr(value, "items"):
        return {name: exact(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [exact(each) for each in value]
    return (type(value), value)


def assert_same(one: Any, other: Any) -> None:
    for field in fields(one):
        if field.name not in ("estimate", "untrusted"):
            assert exact(getattr(one, field.name)) == exact(getattr(other, field.name)), field.name


@SETTINGS
@given(
    st.builds(
        Target,
        number=st.integers(1, 99_999),
        kind=st.just("phantom"),
        name=WORDS,
        note=WORDS,
        truth=st.dictionaries(WORDS.filter(bool), st.floats(-1e9, 1e9), max_size=4),
        made=MOMENTS,
        id=WORDS,
        version=st.integers(1, 2**53),
    )
)
def test_a_target_comes_back_bit_for_bit(target: Target) -> None:
    assert_same(target, from_json_value(Target, through_json(to_json_value(target)), "target", complete=True))


@SETTINGS
@given(
    st.builds(
        StoredPress,
        role=st.sampled_from(("target", "plain", "untouched", "ball")),
        taken=MOMENTS,
        frame=st.binary(min_size=32, max_size=32).map(bytes.hex),
        rows=st.integers(1, 9000),
        columns=st.integers(1, 9000),
        full_scale=st.floats(1.0, 65535.0),
        force_n=st.none() | st.floats(0.0, 100.0),
        mm_per_pixel=st.none() | st.tuples(st.floats(1e-4, 10.0), st.floats(1e-4, 10.0)),
        axis_px=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)),
        probe=WORDS,
        calibration=st.none() | WORDS,
        flags=st.lists(WORDS, max_size=3).map(tuple),
        settings=FREE,
        name=WORDS,
        note=WORDS,
        id=WORDS,
        target=WORDS,
        version=st.integers(1, 2**53),
    )
)
def test_a_press_comes_back_bit_for_bit(press: StoredPress) -> None:
    assert_same(press, from_json_value(StoredPress, through_json(to_json_value(press)), "press", complete=True))


@st.composite
def estimates(draw: st.DrawFn) -> StoredEstimate:
    names = draw(st.lists(WORDS.filter(bool), max_size=4, unique=True))
    spreads = st.floats(1e-300, 1e300)
    found = Estimate(
        samples={name: np.array(draw(st.lists(FLOATS, min_size=1, max_size=5))) for name in names},
        prior_sd={name: draw(spreads) for name in names},
        cramer_rao_sd={name: draw(st.just(math.inf) | spreads) for name in names if draw(st.booleans())},
        presence=draw(st.none() | st.floats(0, 1)),
        log_bayes_factor=draw(st.none() | st.floats(-1e12, 1e12)),
        identifiability=draw(WORDS),
        prior=draw(WORDS),
        trusted=draw(st.booleans()),
        presence_trusted=draw(st.booleans()),
        flags=tuple(draw(st.lists(WORDS, max_size=2))),
        notes=tuple(draw(st.lists(WORDS, max_size=2))),
        provenance=draw(FREE),
    )
    return StoredEstimate(
        kind=draw(st.sampled_from(("inclusion", "hardness"))),
        estimate=found,
        made=draw(MOMENTS),
        probe=draw(WORDS),
        presses=tuple(draw(st.lists(WORDS, max_size=3))),
        calibration=draw(WORDS),
        options=draw(FREE),
        environment=draw(FREE),
        supersedes=draw(st.none() | WORDS),
        id=draw(WORDS),
        target=draw(WORDS),
    )


@SETTINGS
@given(estimates())
def test_an_estimate_and_its_samples_come_back_bit_for_bit(stored: StoredEstimate) -> None:
    samples = samples_of(samples_bytes(stored.estimate))
    back = estimate_from_json(through_json(estimate_to_json(stored)), samples)
    assert_same(stored, back)
    assert_same(stored.estimate, back.estimate)
    assert exact(back.estimate.prior_sd) == exact(stored.estimate.prior_sd)
    assert list(back.estimate.untrusted.samples) == list(stored.estimate.untrusted.samples)
    for name, values in stored.estimate.untrusted.samples.items():
        assert back.estimate.untrusted.samples[name].tobytes() == values.tobytes()


def test_what_is_no_json_in_settings_becomes_plain() -> None:
    plain = free_to_json(
        {
            "gain": np.float32(0.5),
            "binning": np.int16(2),
            "roi": (0, (8, 16)),
            "file": PurePosixPath("/a/b.png"),
            "lamps": np.array([[1.5, 2.0]]),
            "on": np.True_,
            "since": datetime(2026, 1, 2, tzinfo=UTC),
            3: "number",
            "drift": math.nan,
        },
        "settings",
    )
    assert plain == {
        "gain": 0.5,
        "binning": 2,
        "roi": [0, [8, 16]],
        "file": "/a/b.png",
        "lamps": [[1.5, 2.0]],
        "on": True,
        "since": "2026-01-02T00:00:00+00:00",
        "3": "number",
        "drift": {"$number": "nan"},
    }


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ({"a": object()}, r"settings\.a must be a number, text"),
        ({"a": 2**64}, "at most 64 bits"),
        ({"a": b"x"}, "got a bytes"),
        ({1: 2, "1": 3}, "names that differ"),
        ({"$number": 3}, "names that differ"),
    ],
)
def test_what_would_not_come_back_is_refused(value: object, says: str) -> None:
    with pytest.raises(InputError, match=says):
        free_to_json(value, "settings")


def test_nesting_without_end_is_refused_both_ways() -> None:
    endless: list[Any] = []
    endless.append(endless)
    with pytest.raises(InputError, match="nested at most"):
        free_to_json(endless, "settings")
    plain = to_json_value(sample_record().presses[0])
    deep: Any = 1
    for _ in range(50):
        deep = {"a": deep}
    with pytest.raises(InputError, match="nested at most"):
        from_json_value(StoredPress, plain | {"settings": deep}, "press", complete=True)


@pytest.mark.parametrize(
    "change",
    [
        {"rows": 0},
        {"rows": 1.5},
        {"rows": True},
        {"columns": "3"},
        {"full_scale": None},
        {"full_scale": math.inf},
        {"force_n": math.nan},
        {"force_n": 10**400},
        {"mm_per_pixel": [1.0]},
        {"axis_px": [1.0, "2"]},
        {"taken": "yesterday"},
        {"taken": "2026-01-01T00:00:00"},
        {"flags": "moving"},
        {"settings": []},
        {"settings": {"a": {"$number": "seven"}}},
        {"settings": {"a": math.inf}},
        {"role": "finger"},
        {"unknown": 1},
        {"note": 3},
    ],
)
def test_a_press_with_another_value_is_refused(change: dict[str, Any]) -> None:
    plain = to_json_value(sample_record().presses[0])
    from_json_value(StoredPress, plain, "press", complete=True)
    with pytest.raises(InputError):
        from_json_value(StoredPress, plain | change, "press", complete=True)


def test_every_changed_byte_of_samples_is_refused() -> None:
    content = samples_bytes(
        Estimate(samples={"depth_mm": np.array([1.0, 2.5]), "e": np.ones(1)}, prior_sd={"depth_mm": 1.0, "e": 1.0})
    )
    assert list(samples_of(content)) == ["depth_mm", "e"]
    for at in range(len(content)):
        for change in (1, 0x80):
            with pytest.raises(FileInputError):
                samples_of(content[:at] + bytes([content[at] ^ change]) + content[at + 1 :])
    for end in range(len(content)):
        with pytest.raises(FileInputError):
            samples_of(content[:end])
    with pytest.raises(FileInputError):
        samples_of(content + b"\0")


def forged(header: bytes, data: bytes) -> bytes:
    rest = header + data
    return b"tsis-samples 1\n" + hashlib.sha256(rest).hexdigest().encode() + b"\n" + rest


@pytest.mark.parametrize(
    ("header", "data"),
    [
        (b'{"parameters":[["a",1]]}\n', struct.pack("<d", math.nan)),
        (b'{"parameters":[["a",1]]}\n', b""),
        (b'{"parameters":[["a",99999999999]]}\n', b""),
        (b'{"parameters":[["a",-1]]}\n', b""),
        (b'{"parameters":[["a",1],["a",1]]}\n', bytes(16)),
        (b'{"parameters":[["a\\n",1]]}\n', bytes(8)),
        (b'{"parameters":7}\n', b""),
        (b"[" * 5000 + b"\n", b""),
        (b"7\n", b""),
        (b"", b""),
        (b"\xff\n", b""),
    ],
)
def test_samples_forged_with_a_right_hash_are_refused(header: bytes, data: bytes) -> None:
    with pytest.raises(FileInputError):
        samples_of(forged(header, data), "estimate-1.samples")
