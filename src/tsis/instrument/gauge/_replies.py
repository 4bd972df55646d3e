"""Replies of a force gauge on its serial line: a sign, a number and perhaps a unit.

The syntax is common to Mecmesin's and Mark-10's gauges: ``-0.123 N``, ``+1.20``, ``  18.78 lbF``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum, auto

from tsis.errors import GaugeError, InputError

STANDARD_GRAVITY_M_PER_S2 = 9.80665
_POUND_KG = 0.45359237  # exact, international pound of 1959

NEWTONS = {
    "N": 1.0,
    "mN": 1e-3,
    "kN": 1e3,
    "gf": 1e-3 * STANDARD_GRAVITY_M_PER_S2,
    "kgf": STANDARD_GRAVITY_M_PER_S2,
    "lbf": _POUND_KG * STANDARD_GRAVITY_M_PER_S2,
    "ozf": _POUND_KG / 16 * STANDARD_GRAVITY_M_PER_S2,
}
LONGEST_REPLY_BYTES = 64

# Gauges differ in capitals (lbF, KGF); only a capital M would change the meaning, and no gauge reads meganewtons.
_BY_LOWER_CASE = {unit.lower(): unit for unit in NEWTONS}
_NUMBER = re.compile(rb"([+-]?) *(\d{0,9})(?:\.(\d{0,9}))? *([A-Za-z]*)")
_OVERLOAD = re.compile(rb"[+-]? *(?:O\.?L|OVER(?:LOAD| LOAD)?|HELP|-{2,})(?: *[A-Za-z]{1,3})?", re.IGNORECASE)
_FAULT = re.compile(rb"x{3,}|\*\d\d|ERR.*", re.IGNORECASE)


class ReplyKind(Enum):
    """Kind of a gauge's line."""

    NUMBER = auto()
    OVERLOAD = auto()  # more force than the gauge can measure
    FAULT = auto()  # the gauge reports an error of its own
    GARBAGE = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """A parsed line of a gauge; only a number has the further fields."""

    kind: ReplyKind
    number: float = 0.0  # in the gauge's unit
    step: float = 0.0  # value of its last digit
    unit: str = ""  # one of `NEWTONS`; empty when the gauge did not send one


def read_reply(line: bytes) -> Reply:
    """Parse a line without its end; it never raises.

    Examples
    --------
    >>> read_reply(b" -18.78 lbF")
    Reply(kind=<ReplyKind.NUMBER: 1>, number=-18.78, step=0.01, unit='lbf')
    >>> read_reply(b"OL").kind, read_reply(b"0.12 N.m").kind
    (<ReplyKind.OVERLOAD: 2>, <ReplyKind.GARBAGE: 4>)
    """
    text = line.strip()
    if len(text) > LONGEST_REPLY_BYTES:
        return Reply(kind=ReplyKind.GARBAGE)
    if _OVERLOAD.fullmatch(text):
        return Reply(kind=ReplyKind.OVERLOAD)
    if _FAULT.fullmatch(text):
        return Reply(kind=ReplyKind.FAULT)
    return _number(text) or Reply(kind=ReplyKind.GARBAGE)


def _number(text: bytes) -> Reply | None:
    match = _NUMBER.fullmatch(text)
    if match is None:
        return None
    sign, whole, fraction, letters = (part.decode() for part in match.groups(b""))
    unit = _unit(letters)
    if not whole + fraction or unit is None:
        return None
    return Reply(
        kind=ReplyKind.NUMBER,
        number=float(f"{sign}{whole or 0}.{fraction or 0}"),
        step=float(f"1e-{len(fraction)}"),
        unit=unit,
    )


def _unit(letters: str) -> str | None:
    """The unit of that spelling, empty without one, None for any other unit."""
    if letters.startswith("M"):
        return None
    return _BY_LOWER_CASE.get(letters.lower()) if letters else ""


def force_unit(unit: str) -> str:
    """The unit of that spelling; `InputError` when it is not one of the forces in `NEWTONS`."""
    name = _unit(unit) if isinstance(unit, str) else None
    if not name:
        raise InputError(f"unit must be one of {', '.join(NEWTONS)}; got {unit!r:.40}")
    return name


def newtons(reply: Reply, *, unit: str | None) -> tuple[float, float]:
    """Force and step of the display in newtons, with the required unit of replies, None before one is known.

    Raises `GaugeError` when the reply is no number, has another unit, or the unit is unknown.

    Examples
    --------
    >>> newtons(read_reply(b"+250 mN"), unit="mN")
    (0.25, 0.001)
    """
    if reply.kind is ReplyKind.OVERLOAD:
        raise GaugeError("it reports an overload; take the load off, check its zero, and start the readings again")
    if reply.kind is ReplyKind.FAULT:
        raise GaugeError("it reports a fault of its own; look at its display and its manual")
    if reply.kind is ReplyKind.GARBAGE:
        raise GaugeError("it sent something that is no reading")
    if not reply.unit and unit is None:
        raise GaugeError("it sends numbers without a unit; state the unit that its display shows, e.g. unit='N'")
    if unit is not None and reply.unit not in ("", unit):
        raise GaugeError(
            f"its replies must be in {unit}; got one in {reply.unit}; set the gauge, or state unit={reply.unit!r}"
        )
    scale = NEWTONS[reply.unit or str(unit)]
    return reply.number * scale, reply.step * scale
