"""Which status an error becomes, and that whatever is sent is answered in one sentence."""

from __future__ import annotations

import errno
import json
import sqlite3
from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tsis import errors
from tsis.console.api.responses import kind_of, message_of, problem
from tsis.console.statuses import AbsentError, NoControlError, status_of

if TYPE_CHECKING:
    from tests.console.api.script import Script

AS_JSON = {"Content-Type": "application/json"}


def caused(error: errors.TsisError, cause: BaseException) -> errors.TsisError:
    """The error as it is when it was raised from a cause."""
    error.__cause__ = cause
    return error


def sqlite_error(code: int) -> sqlite3.OperationalError:
    error = sqlite3.OperationalError("as the library says it")
    error.sqlite_errorcode = code
    return error


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (errors.InputError("a"), 422),
        (errors.UnknownNameError("a"), 422),
        (errors.FileInputError("a"), 422),
        (errors.CalibrationError("a"), 422),
        (errors.NotCalibratedError("a"), 422),
        (errors.MechanicsError("a"), 422),
        (AbsentError("a"), 404),
        (errors.ControlError("a"), 409),
        (NoControlError("a"), 428),
        (errors.StaleRecordError("a"), 409),
        (errors.MissingExtraError("a"), 501),
        (errors.CameraError("a"), 503),
        (errors.GaugeError("a"), 503),
        (errors.RecordsError("a"), 503),
        (caused(errors.FileInputError("a"), OSError(errno.ENOSPC, "full")), 507),
        (caused(errors.FileInputError("a"), OSError(errno.EDQUOT, "full")), 507),
        (caused(errors.FileInputError("a"), OSError(errno.EACCES, "no")), 503),
        (caused(errors.RecordsError("a"), caused(errors.FileInputError("b"), OSError(errno.ENOSPC, "full"))), 507),
        (caused(errors.RecordsError("a"), sqlite_error(sqlite3.SQLITE_FULL)), 507),
        (caused(errors.RecordsError("a"), sqlite_error(sqlite3.SQLITE_BUSY)), 503),
        (caused(errors.InputError("a"), OSError(errno.ENOSPC, "full")), 422),
    ],
)
def test_a_status_tells_whose_error_it_is(error: errors.TsisError, status: int) -> None:
    assert status_of(error) == status


def test_the_kind_is_a_class_that_programs_know() -> None:
    assert kind_of(AbsentError("a")) == "UnknownNameError"
    assert kind_of(NoControlError("a")) == "ControlError"
    assert kind_of(errors.GaugeError("a")) == "GaugeError"


def test_every_error_of_the_program_has_a_status_below_500_or_a_documented_one() -> None:
    kinds = [item for item in vars(errors).values() if isinstance(item, type) and issubclass(item, errors.TsisError)]
    assert len(kinds) > 10
    assert {status_of(kind("a")) for kind in kinds} <= {404, 409, 422, 428, 501, 503, 507}


@given(st.text())
@example("a\nb\x1b[2J")
def test_any_sentence_is_sent_as_one_printable_line(text: str) -> None:
    """A name that a caller made up is quoted in the message: half a letter and control characters are spelt out."""
    sent = json.loads(bytes(problem(422, text + "\ud800", "InputError").body))["error"]
    assert sent.isprintable()
    assert sent.endswith(("\\ud800", "…"))
    if text.isprintable() and len(text) < 900:
        assert sent == text + "\\ud800"


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_any_value_can_be_told_of(value: object) -> None:
    fault = {"type": "value_error", "loc": ("body", "force_n"), "msg": "Value error, must be so", "input": value}
    reported = message_of([fault, fault])
    assert reported.startswith("force_n: must be so; got ")
    assert "(and 1 more)" in reported
    assert len(reported) < 200
    assert "\n" not in reported


@pytest.mark.system
@pytest.mark.parametrize(
    ("content", "status", "label"),
    [
        (b'{"number": NaN}', 422, "got nan"),
        (b'{"number": -Infinity}', 422, "got -inf"),
        (b'{"number": 1e999}', 422, "got inf"),
        (b'{"number": true}', 422, "got True"),
        (b'{"number": "1"}', 422, "got '1'"),
        (b'{"number": 0}', 422, "got 0"),
        (b'{"number": 100000}', 422, "got 100000"),
        (b'{"number": 1.5}', 422, "got 1.5"),
        (b'{"number": ' + b"9" * 400 + b"}", 422, "a number of about 400 digits"),
        (b'{"number": ' + b"9" * 5000 + b"}", 400, "JSON"),
        (b'{"number": ' + b"[" * 100_000 + b"}", 400, "JSON"),
        (b'{"number": "\\ud800"}', 422, "ud800"),
        (b'{"number": 1, "\\u0000": 2}', 422, "extra"),
        (b'{"number": 1', 422, "must be JSON"),
        (b"\xff\xfe{", 400, "JSON"),
        (b"", 422, "the body must be given"),
        (b"[]", 422, "got a list"),
        (b"null", 422, "the body"),
    ],
)
def test_whatever_is_sent_is_answered_in_one_sentence(holder: Script, content: bytes, status: int, label: str) -> None:
    _, message = holder.refused("PUT", "/target", status, content=content, headers=AS_JSON)
    assert label in message


@pytest.mark.system
def test_a_body_says_what_it_is(holder: Script) -> None:
    for kind in ("text/plain", "application/xml", "multipart/form-data"):
        _, message = holder.refused("PUT", "/target", 415, content=b'{"number": 1}', headers={"Content-Type": kind})
        assert "application/json" in message


@pytest.mark.system
def test_an_address_that_is_no_call_says_so(script: Script) -> None:
    for address in ("/nothing", "/state/", "/targets/1/..%2f..%2fabout", "/jobs/"):
        assert "/api/openapi.json" in script.refused("GET", address, 404)[1]
    answer = script.client.post("/about")
    assert answer.status_code == 405
    assert answer.headers["Allow"] == "GET"
    for number in ("0", "100000", "NaN", "1e3", "-1", "x", "%ED%A0%80", "9" * 5000):
        script.refused("GET", f"/targets/{number}", 422)


@pytest.mark.system
@pytest.mark.parametrize("control", ["%00", "%0A", "1%0A", "%0D%0A", "%7F"])
def test_a_control_character_in_an_address_is_refused_at_the_gate(script: Script, control: str) -> None:
    answer = script.client.get(f"/targets/{control}/estimates")
    assert answer.status_code == 400
    assert answer.text.strip() == "The request is malformed."
