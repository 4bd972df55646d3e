from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import GaugeError, InputError
from tsis.instrument.serial_gauge import NEWTONS, ReplyKind, force_unit, newtons, read_reply

# From NIST SP 811, appendix B.8, and multiples by SI prefixes.
IN_NEWTONS = {
    "N": 1.0,
    "mN": 0.001,
    "kN": 1000.0,
    "gf": 9.80665e-3,
    "kgf": 9.80665,
    "lbf": 4.4482216152605,
    "ozf": 0.27801385095378125,
}


@pytest.mark.parametrize("unit", IN_NEWTONS)
def test_every_unit_is_converted(unit: str) -> None:
    force, step = newtons(read_reply(b"-2.50 " + unit.encode()), unit=unit)
    assert force == pytest.approx(-2.5 * IN_NEWTONS[unit], rel=1e-14)
    assert step == pytest.approx(0.01 * IN_NEWTONS[unit], rel=1e-14)


def test_all_known_units_are_tested() -> None:
    assert set(IN_NEWTONS) == set(NEWTONS)


@pytest.mark.parametrize(
    ("line", "number", "step", "unit"),
    [
        (b"+0.123", 0.123, 0.001, ""),
        (b" - 18.78 lbF\r", -18.78, 0.01, "lbf"),
        (b"4.285 N", 4.285, 0.001, "N"),
        (b"12KGF", 12.0, 1.0, "kgf"),
        (b".5 n", 0.5, 0.1, "N"),
        (b"5. mN", 5.0, 1.0, "mN"),
    ],
)
def test_what_gauges_send_is_read(line: bytes, number: float, step: float, unit: str) -> None:
    reply = read_reply(line)
    assert (reply.kind, reply.number, reply.step, reply.unit) == (ReplyKind.NUMBER, number, step, unit)


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b".",
        b"N",
        b"+",
        b"-",
        b"1,5 N",
        b"1.2.3 N",
        b"1e3 N",
        b"nan",
        b"inf N",
        b"0x10",
        b"--1",
        b"1 2 N",
        b"5 MN",  # no gauge reads meganewtons: a millinewton misspelt would be a billion times too large
        b"0.12 N.m",
        b"0.12 Nm",
        b"12 kg",
        b"18.780 N Peak",
        "١٢ N".encode(),
        b"\x00\xff\x80",
        b"1" * 65,
        b"1" * 10,
    ],
)
def test_what_is_no_force_is_garbage(line: bytes) -> None:
    assert read_reply(line).kind is ReplyKind.GARBAGE
    with pytest.raises(GaugeError, match="no reading"):
        newtons(read_reply(line), unit="N")


@pytest.mark.parametrize("line", [b"OL", b"-OL N", b"+O.L", b"OVER", b"overload", b"----", b"--", b"HELP", b"- OL"])
def test_an_overload_is_no_number(line: bytes) -> None:
    assert read_reply(line).kind is ReplyKind.OVERLOAD
    with pytest.raises(GaugeError, match="overload"):
        newtons(read_reply(line), unit="N")


@pytest.mark.parametrize("line", [b"xxxx", b"*10", b"ERR 3"])
def test_a_fault_of_the_gauge_is_no_number(line: bytes) -> None:
    with pytest.raises(GaugeError, match="fault of its own"):
        newtons(read_reply(line), unit="N")


def test_units_must_agree_and_be_known() -> None:
    with pytest.raises(GaugeError, match=r"must be in N; got one in lbf; .*unit='lbf'"):
        newtons(read_reply(b"1.0 lbf"), unit="N")
    with pytest.raises(GaugeError, match="without a unit; state"):
        newtons(read_reply(b"1.0"), unit=None)
    assert newtons(read_reply(b"1.0"), unit="kN") == (1000.0, 100.0)
    assert force_unit("LBF") == "lbf"
    for wrong in ("", "kg", "MN", "N.m", 3):
        with pytest.raises(InputError, match="unit must be one of N, mN"):
            force_unit(wrong)  # type: ignore[arg-type]


@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_but_a_gauge_error(line: bytes) -> None:
    reply = read_reply(line)
    try:
        force, step = newtons(reply, unit="N")
    except GaugeError:
        return
    assert reply.kind is ReplyKind.NUMBER
    assert math.isfinite(force)
    assert step > 0


@given(
    st.integers(-(10**9) + 1, 10**9 - 1),
    st.integers(0, 6),
    st.sampled_from(sorted(IN_NEWTONS)),
    st.sampled_from(["", " ", "   "]),
)
def test_numbers_come_back(digits: int, places: int, unit: str, space: str) -> None:
    number = digits / 10**places
    reply = read_reply(f"{number:+.{places}f}{space}{unit}".encode())
    assert (reply.kind, reply.unit) == (ReplyKind.NUMBER, unit)
    assert reply.number == float(f"{number:.{places}f}")
    assert reply.step == pytest.approx(10.0**-places)
