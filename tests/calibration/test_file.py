"""The file of a calibration and its parts: what comes back, what is refused, for whom and until when it holds."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import zlib
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.calibration.bench import (
    LATER,
    MADE,
    bench,
    bench_line,
    bench_reference,
    bench_scale,
    measured,
    sheet,
)

from tsis.calibration.file import (
    ProbeCalibration,
    calibration_bytes,
    calibration_sha256,
    parse_calibration,
    read_calibration,
    read_handwritten_calibration,
    write_calibration,
)
from tsis.calibration.force_line import ForceLine
from tsis.calibration.scale import PixelScale
from tsis.errors import CalibrationError, FileInputError, InputError, TsisError
from tsis.files.json_values import require_bounded_arrays
from tsis.model.calibration import Calibration

if TYPE_CHECKING:
    from pathlib import Path


LARGE_MAPS = ("dark_grey", "untouched_grey", "relative_light")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "bench.json"


def test_everything_comes_back(path: Path) -> None:
    known = bench()
    cited = write_calibration(known, path)
    again = read_calibration(path)
    assert cited == calibration_sha256(known) == calibration_sha256(again)
    assert again.scale == known.scale
    assert again.scale is not None
    assert again.scale.mm_per_pixel_x.degrees_of_freedom == 40.5
    assert again.response == known.response
    assert (again.made, again.expires, dict(again.settings)) == (MADE, LATER, {"exposure_ms": 20.0, "gain": 0.0})
    assert again.reference is not None
    assert known.reference is not None
    np.testing.assert_allclose(again.reference.dark_grey, known.reference.dark_grey, rtol=1e-6)
    np.testing.assert_array_equal(again.reference.usable, known.reference.usable)
    assert again.force_line is None
    assert math.isinf(again.reference.read_noise_grey.degrees_of_freedom)


def test_people_can_read_it(path: Path) -> None:
    write_calibration(bench(), path)
    text = path.read_text()
    assert '"gain_grey_per_kpa": 60' in text
    assert '"expires": "2027-05-21T10:00:00+00:00"' in text
    assert "Research use only" in text


def test_it_is_named_by_its_content_alone(path: Path) -> None:
    assert calibration_sha256(bench()) == calibration_sha256(bench())
    assert calibration_sha256(bench()) != calibration_sha256(bench(name="other"))
    assert calibration_sha256(bench()) != calibration_sha256(bench(scale=bench_scale(x=0.0337)))
    assert bench().cited_response("0123456789abcdef").name == "bench (0123456789ab)"
    write_calibration(bench(), path)
    write_calibration(bench(), path.with_name("elsewhere.json"))
    assert path.read_bytes() == path.with_name("elsewhere.json").read_bytes()


def _leaves(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    if isinstance(value, dict):
        return [leaf for name, each in value.items() for leaf in _leaves(each, (*at, name))]
    if isinstance(value, list):
        return [leaf for number, each in enumerate(value) for leaf in _leaves(each, (*at, number))]
    return [at]


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_changed_value_is_noticed(path: Path, data: st.DataObject) -> None:
    document = json.loads(calibration_bytes(bench()))
    at = data.draw(st.sampled_from(_leaves(document["calibration"])))
    place: Any = document["calibration"]
    for step in at[:-1]:
        place = place[step]
    old = place[at[-1]]
    new: Any = data.draw(
        st.one_of(st.none(), st.floats(allow_nan=False), st.text(max_size=5), st.booleans(), st.just([]))
    )
    if (type(new) is type(old) and new == old) or (isinstance(old, (int, float)) and new == old):
        return
    place[at[-1]] = new
    path.write_text(json.dumps(document))
    with pytest.raises((CalibrationError, FileInputError), match=r"changed|damaged|must be"):
        read_calibration(path)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.floats(0, 1), new=st.binary(max_size=4), cut=st.booleans())
def test_damaged_files_are_one_sentence_never_another_calibration(path: Path, at: float, new: bytes, cut: bool) -> None:
    whole = calibration_bytes(bench())
    place = int(at * len(whole))
    path.write_bytes(whole[:place] + (b"" if cut else new + whole[place + len(new) :]))
    try:
        again = read_calibration(path)
    except TsisError:
        return
    assert calibration_sha256(again) == calibration_sha256(
        bench()
    )  # what was hit lies outside the calibration: notice, spaces


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (b"", "must hold data"),
        (b"[]", "must hold a JSON object"),
        (b'{"format": "else"}', "must be a file of tsis-calibration; got 'else'"),
        (b'{"format": "tsis-calibration", "version": 2}', r"must be of version 1; got 2 \(calibrate again"),
        (b'{"format": "tsis-calibration", "version": 1, "calibration": {}, "sha256": null}', "changed or damaged"),
        (b'{"format": "tsis-calibration", "version": 1, "calibration": NaN, "sha256": ""}', "changed|must be"),
        (b"[" * 100_000, "readable JSON"),
        (b"\xff\xfe\x00", "readable JSON"),
    ],
)
def test_other_files_are_refused(path: Path, wrong: bytes, said: str) -> None:
    path.write_bytes(wrong)
    with pytest.raises((FileInputError, CalibrationError), match=said):
        read_calibration(path)


def _documented_hash(content: Any) -> str:
    """The rule of the file's description, written anew."""

    def stripped(value: Any) -> Any:
        if isinstance(value, dict):
            maps = set(value) == {"shape", "kind", "sha256", "zlib"}
            return {name: stripped(each) for name, each in value.items() if not (maps and name == "zlib")}
        if isinstance(value, list):
            return [stripped(each) for each in value]
        return float(value) if type(value) is int else value

    return hashlib.sha256(json.dumps(stripped(content), sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def test_the_hash_is_the_documented_one_whatever_packed_the_maps() -> None:
    document = json.loads(calibration_bytes(bench()))
    assert document["sha256"] == _documented_hash(document["calibration"]) == calibration_sha256(bench())
    dark = document["calibration"]["reference"]["dark_grey"]
    raw = zlib.decompress(base64.b64decode(dark["zlib"]))
    assert hashlib.sha256(raw).hexdigest() == dark["sha256"]


def test_maps_packed_otherwise_are_the_same_calibration(path: Path) -> None:
    document = json.loads(calibration_bytes(bench()))
    dark = document["calibration"]["reference"]["dark_grey"]
    dark["zlib"] = base64.b64encode(zlib.compress(zlib.decompress(base64.b64decode(dark["zlib"])), 1)).decode()
    path.write_text(json.dumps(document))
    assert calibration_sha256(read_calibration(path)) == document["sha256"]


def _resealed(path: Path, change: Any) -> None:
    """A file whose hash is right and whose content is not what this program writes."""
    document = json.loads(calibration_bytes(bench()))
    change(document["calibration"])
    document["sha256"] = _documented_hash(document["calibration"])
    path.write_text(json.dumps(document))


def test_values_out_of_range_are_refused_even_when_the_hash_is_right(path: Path) -> None:
    noise = base64.b64encode(zlib.compress(bytes(30 * 40 * 8))).decode()
    short = {"shape": [40, 40], "kind": "single", "sha256": "", "zlib": "eJxjYGAYBaNgFAAAAAUAAQ=="}
    bomb = {"shape": [4000, 4000], "kind": "single", "sha256": "", "zlib": "eJxjYGAYBaNgFAAAAAUAAQ=="}
    cases: list[tuple[Any, str]] = [
        (lambda known: known["response"].update(gain_grey_per_kpa=-1.0), "gain_grey_per_kpa must lie in"),
        (lambda known: known["response"].update(pressure=1.0), "only known values"),
        (lambda known: known["scale"].pop("count"), "must hold all of"),
        (lambda known: known["scale"].update(shape=[1]), "a list of 2"),
        (lambda known: known.update(settings={"gain": "1"}), "settings.gain must be a number"),
        (lambda known: known.update(expires="soon"), "date and time"),
        (lambda known: known.update(expires="2026-01-01T00:00:00+00:00"), "expires must lie after made"),
        (lambda known: known["reference"].update(dark_grey=short), "whole map"),
        (lambda known: known["reference"].update(dark_grey=bomb), "whole map"),
        (
            lambda known: known["reference"].update(dict.fromkeys(LARGE_MAPS, bomb | {"kind": "double"})),
            "at most 268435456 bytes; got 384",
        ),
        (lambda known: known["reference"]["dark_grey"].update(zlib=noise), "does not match its hash"),
        (lambda known: known["reference"]["dark_grey"].update(shape=[10**9, 10**9]), "sensible size"),
        (lambda known: known["scale"].update(count=True), "count must be"),
    ]
    for change, said in cases:
        _resealed(path, change)
        with pytest.raises((FileInputError, CalibrationError), match=said):
            read_calibration(path)


def _dark(side: tuple[int, int], lit: float) -> ProbeCalibration:
    """Of a camera that sees zeros almost everywhere."""
    rng = np.random.default_rng(2)
    dark, untouched = ((rng.random(side, dtype=np.float32) < lit) * rng.integers(1, 4, side) / 16 for _ in range(2))
    reference = replace(
        bench_reference(),
        dark_grey=dark,
        untouched_grey=untouched,
        relative_light=np.ones(side),
        usable=np.ones(side, bool),
    )
    return bench(reference=reference, scale=replace(bench_scale(), shape=side))


@pytest.mark.parametrize(
    ("rows", "columns", "lit"),
    [(512, 612, 0.0), (512, 612, 1e-3), pytest.param(2048, 2448, 1e-2, marks=pytest.mark.slow)],
)
def test_maps_that_are_almost_all_zero_come_back(path: Path, rows: int, columns: int, lit: float) -> None:
    known = _dark((rows, columns), lit)
    written = write_calibration(known, path)
    assert path.stat().st_size < rows * columns * (3 * 4 + 1) / 100  # of what the maps take
    back = read_calibration(path)
    assert calibration_sha256(back) == written
    assert back.reference is not None
    assert known.reference is not None
    np.testing.assert_array_equal(back.reference.dark_grey, known.reference.dark_grey)


def test_what_could_not_be_read_back_is_not_written(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = _dark((30, 40), 0.5)
    size = len(calibration_bytes(known))
    monkeypatch.setitem(calibration_bytes.__globals__, "LARGEST_BYTES", size - 1)
    with pytest.raises(InputError, match=f"at most {size - 1} bytes"):
        write_calibration(known, path)
    monkeypatch.setitem(calibration_bytes.__globals__, "LARGEST_BYTES", size)
    write_calibration(known, path)
    read_calibration(path)
    bounds = require_bounded_arrays.__globals__
    monkeypatch.setitem(bounds, "MOST_UNPACKED", 30 * 40 * (3 * 4 + 1))
    assert calibration_sha256(parse_calibration(path.read_bytes(), "a file")) == calibration_sha256(known)
    monkeypatch.setitem(bounds, "MOST_UNPACKED", 30 * 40 * (3 * 4 + 1) - 1)
    with pytest.raises(InputError, match="unpack to at most 15599 bytes; got 15600"):
        calibration_bytes(known)
    with pytest.raises(FileInputError, match=r"a file: .* at most 15599 bytes"):
        parse_calibration(path.read_bytes(), "a file")


def test_values_written_by_hand_are_valid_for_the_days_that_are_given(path: Path) -> None:
    path.write_text(
        json.dumps(
            {"name": "hand", "probe": "tsis-2011", "response": {"gain_grey_per_kpa": 50.0, "saturation_kpa": 20.0}}
        )
    )
    before = datetime.now(UTC).replace(microsecond=0)
    found = read_handwritten_calibration(path, 2.5)
    assert found.made is not None
    assert found.expires is not None
    assert before <= found.made <= datetime.now(UTC)
    assert (found.expires - found.made).total_seconds() == 2.5 * 86_400


def test_nothing_is_written_over(path: Path) -> None:
    write_calibration(bench(), path)
    before = path.read_bytes()
    with pytest.raises(FileInputError, match="exists already"):
        write_calibration(bench(name="new"), path)
    assert path.read_bytes() == before
    (path.parent / "file").write_text("")
    with pytest.raises(FileInputError, match="can be written"):
        write_calibration(bench(), path.parent / "file" / "bench.json")


@pytest.mark.parametrize(
    ("use", "said"),
    [
        ({"now": LATER + timedelta(seconds=1)}, "must not be expired; it was good until 2027-05-21"),
        ({"now": MADE - timedelta(days=1)}, "must not come from the future"),
        ({"now": MADE, "probe": "tsis-domed"}, "must be of the probe in use, 'tsis-domed'; it is of 'tsis-2011'"),
        ({"now": MADE, "camera": "another"}, "must be of the camera in use, 'another'"),
        ({"now": MADE, "settings": {"exposure_ms": 10.0}}, "holds at exposure_ms = 20; the camera is at 10"),
    ],
)
def test_expired_and_foreign_calibrations_are_refused(use: dict[str, Any], said: str) -> None:
    with pytest.raises(CalibrationError, match=re.escape(said)):
        bench().require_usable(**use)


def test_its_own_probe_may_use_it_in_any_time_zone() -> None:
    east = timezone(timedelta(hours=9))
    now = (MADE + timedelta(minutes=1)).astimezone(east)
    bench().require_usable(
        now, probe="tsis-2011", camera="Aravis-TSIS01", settings={"exposure_ms": 20.0000001, "brightness": 3.0}
    )
    bench(probe="", camera="", settings={}).require_usable(now, probe="any", camera="any", settings={"gain": 9.0})


def test_a_part_that_was_not_measured_is_named() -> None:
    with pytest.raises(CalibrationError, match="a force needs the part 'force_line', which calibration 'bench'"):
        bench().need(ForceLine, "a force")
    assert bench().need(PixelScale, "a size") == bench_scale()


@pytest.mark.parametrize(
    "wrong",
    [
        {"made": datetime(2026, 1, 1)},
        {"made": None},
        {"expires": MADE},
        {"settings": {"gain": math.nan}},
        {"scale": 0.05},
        {"name": None},
        {"expires": None},
        {"made": datetime(1, 1, 1, tzinfo=timezone(timedelta(hours=23, minutes=59)))},
        {"expires": datetime(9999, 12, 31, 23, 59, tzinfo=timezone(-timedelta(hours=23, minutes=59)))},
        {"made": datetime(1999, 12, 31, 12, tzinfo=UTC)},
        {"expires": datetime(2201, 1, 1, tzinfo=UTC)},
        {"made": "2026-11-22"},
        {"name": "\ud800"},
        {"name": "bench\n2"},
        {"probe": "\x1b[31mtsis"},
        {"camera": "c" * 201},
        {"settings": {"gain\n": 1.0}},
    ],
)
def test_values_that_make_no_calibration_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong)).removesuffix("s")) as caught:
        bench(**wrong)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 300


def test_the_longest_name_and_the_first_and_last_year_are_taken() -> None:
    far = {"made": datetime(2000, 1, 1, tzinfo=UTC), "expires": datetime(2200, 12, 31, tzinfo=UTC)}
    known = bench(name="ä" * 200, force_line=bench_line(), specification=sheet(), **far)
    east, west = (timezone(sign * timedelta(hours=23, minutes=59)) for sign in (1, -1))
    known.require_usable(MADE.astimezone(east))
    known.require_usable(MADE.astimezone(west))
    assert bench(made=None, expires=None).made is None


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (
            {"force_line": bench_line(slope_grey_per_n=measured(1e5, "grey/mN"))},
            "slope_grey_per_n must be in grey/N; got",
        ),
        ({"force_line": bench_line(intercept_grey=measured(9.0))}, "force_line.intercept_grey must be in grey; got ''"),
        ({"force_line": bench_line(residual_share=measured(0.1, "%"))}, "residual_share must be in no unit"),
        (
            {"force_line": bench_line(residual_grey=measured(-1.0, "grey"))},
            "residual_grey must not be negative; got -1",
        ),
        (
            {"reference": replace(bench_reference(), read_noise_grey=measured(0.5, "N"))},
            "read_noise_grey must be in grey",
        ),
        ({"reference": replace(bench_reference(), read_noise_grey=measured(-0.5, "grey"))}, "must not be negative"),
        ({"reference": replace(bench_reference(), shot_noise_grey=measured(-0.5, "grey"))}, "must not be negative"),
        (
            {"response": Calibration(gain_grey_per_kpa=60, saturation_kpa=20.0, probe="tsis-domed")},
            "response.probe must be that of the calibration, 'tsis-2011'; got 'tsis-domed'",
        ),
        ({"response": Calibration(gain_grey_per_kpa=60, saturation_kpa=20.0, name="\x1b[2J")}, "response.name must be"),
        ({"specification": sheet(probe="tsis-domed")}, "specification.probe must be that of the calibration"),
        ({"specification": sheet("mN")}, r"specification.rows\[0\].measured must be in mN; got 'N'"),
        ({"specification": sheet(note="a\nb")}, r"specification.rows\[0\].note must be printable"),
    ],
)
def test_parts_that_make_no_sense_are_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        bench(**wrong)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"tips_mm": ()}, "tips_mm must hold the radius of at least one tip"),
        ({"tips_mm": (2.0, -1.0)}, r"tips_mm must lie in \[0.1, 1000\]; got -1"),
        ({"tips_mm": (math.inf,)}, "tips_mm must lie in"),
        ({"unit_covariance": (-1.0, 0.0, 0.0)}, "unit_covariance must lie in"),
        ({"unit_covariance": (0.0, 0.0, -1.0)}, "unit_covariance must lie in"),
        ({"method": "x"}, "no segmentation method is called 'x'"),
    ],
)
def test_force_lines_that_make_no_sense_are_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        bench_line(**wrong)


def test_a_response_that_names_no_probe_is_that_of_the_calibrations() -> None:
    """Else an estimate under another probe would not be refused."""
    silent = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0)
    assert bench(response=silent, probe="tsis-domed").cited_response("0" * 64).probe == "tsis-domed"
    assert bench().cited_response("0" * 64).probe == "tsis-2011"
