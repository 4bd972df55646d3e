"""Fields, uploads and properties that pages share."""

from __future__ import annotations

import ast
import asyncio
import gc
import math
import tempfile
import weakref
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nicegui import Client, ui
from tests.console.pages.open_page import RecordingViewer, on_a_page
from tests.console.services.instruments import FixedGauge, lit_instrument
from tests.waiting import HANGS_S

import tsis.console
from tsis.console.pages.records import import_button
from tsis.console.services.jobs import AT_ONCE
from tsis.console.widgets import FileField, NumberField, number_text_of_field, typed_number
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_what_a_float_prints_is_typed_back(value: float) -> None:
    assert typed_number("force", repr(value)) == value
    assert typed_number("force", f"  {value:.17e} ") == value


@given(st.floats(min_value=-1e6, max_value=1e6))
def test_what_is_shown_is_a_number_near_by(value: float) -> None:
    assert math.isclose(typed_number("force", number_text_of_field(value)), value, rel_tol=1e-4, abs_tol=1e-300)


@given(st.text())
def test_text_is_a_number_as_python_reads_it_or_one_sentence(text: str) -> None:
    refusal = ""
    try:
        value = typed_number("force", text)
    except InputError as error:
        refusal = str(error)
    else:
        assert value == float(text)
    assert refusal.startswith("force must be a number") == bool(refusal)
    assert "\n" not in refusal


@pytest.mark.parametrize("text", ["", "one", "1,5", "1_0", "nan", "inf", "-", ".", "e5", "0x10", "١", "1 2", "1\n2"])
def test_no_number(text: str) -> None:
    with pytest.raises(InputError, match=r"force must be a number, as 2 or 0\.5; got"):
        typed_number("force", text)


def test_a_number_too_large_for_one_is_infinite_for_the_bench_to_refuse() -> None:
    assert typed_number("force", "1e999") == math.inf


def test_nothing_is_shown_of_nothing() -> None:
    assert number_text_of_field(None) == ""
    assert number_text_of_field(5.0) == "5"
    assert number_text_of_field(0.01) == "0.01"


def test_a_state_that_comes_meanwhile_does_not_replace_what_is_refused(tmp_path: Path) -> None:
    async def typed(viewer: RecordingViewer) -> None:
        field = NumberField(viewer, "Force", lambda _: None)
        field.show(1.5)

        async def refusal(act: Callable[[], object]) -> InputError:
            field.show(1.5)  # the page follows the instrument while it refuses
            with pytest.raises(InputError):
                act()
            return InputError("refused")

        viewer.refusal = refusal  # type: ignore[method-assign]
        field._typed()
        field.element.value = "hard"
        await field._done()
        assert (field.element.value, field.element.error) == ("hard", "refused.")

    with lit_instrument(tmp_path) as instrument:
        on_a_page(instrument, typed)


def test_the_answer_to_an_earlier_number_does_not_replace_a_later_one(tmp_path: Path) -> None:
    arrived: list[float] = []

    async def typed(viewer: RecordingViewer) -> None:
        answers: asyncio.Queue[None] = asyncio.Queue()

        async def refusal(act: Callable[[], object]) -> InputError | None:
            act()
            await answers.get()
            return InputError("too large") if arrived[-1] > 24 else None

        viewer.refusal = refusal  # type: ignore[method-assign]
        field = NumberField(viewer, "Gain", arrived.append)
        field.show(2.0)
        sent = []
        for text in ("7.5", "25"):
            field._typed()
            field.element.value = text
            sent.append(asyncio.create_task(field._done()))
            await asyncio.sleep(0)
        answers.put_nowait(None)
        await sent[0]
        assert (field.element.value, field.element.error) == ("25", None)
        answers.put_nowait(None)
        await sent[1]
        assert (field.element.value, field.element.error) == ("25", "Too large.")
        field.show(0.0)
        assert (field.element.value, field.element.error) == ("0", None)

    with lit_instrument(tmp_path) as instrument:
        on_a_page(instrument, typed)
    assert arrived == [7.5, 25.0]


async def _save(file: Path) -> None:
    file.write_bytes(b"no bundle")


def test_the_copy_goes_also_when_the_import_is_ended_before_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (copies := tmp_path / "copies").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(copies))
    monkeypatch.setattr(FileField, "reset", lambda _: None)  # which asks a browser, as the next does
    monkeypatch.setattr(FileField, "name_parts", lambda *_: None)
    with lit_instrument(tmp_path) as instrument:
        owned = [FixedGauge() for _ in range(AT_ONCE)]

        async def uploaded(viewer: RecordingViewer) -> None:
            import_button(instrument, viewer, ui.element("div"))
            (field,) = (item for item in viewer._client.elements.values() if isinstance(item, FileField))
            taken: Any = field._upload_handlers[0]
            await taken(SimpleNamespace(file=SimpleNamespace(save=_save)))
            assert len(list(copies.iterdir())) == 1
            job = instrument.jobs.get(instrument.state().jobs[-1].identity)
            job.end()
            for item in owned:
                item.over.set()
            assert job.wait(HANGS_S)
            assert job.state().status == "ended"

        for item in owned:
            instrument.jobs.begin("long", item)
        on_a_page(instrument, uploaded)
    assert list(copies.iterdir()) == []


class Page:
    """What a page would be, with an act that a field calls."""

    def taken(self, _: object) -> None: ...


def test_a_deleted_field_keeps_nothing_of_its_page() -> None:
    page = Page()
    client = Client(ui.page("/"), request=None)
    with client:
        field = FileField(on_upload=page.taken, on_begin_upload=page.taken, on_multi_upload=page.taken)
    left = weakref.ref(page)
    field.delete()
    del page
    gc.collect()
    assert field.is_deleted
    assert left() is None


FILES = sorted(Path(tsis.console.__file__).parent.rglob("*.py"))


def put_together(source: str) -> list[str]:
    """Arguments of ``props`` that are neither written out nor made of constants."""
    calls = [
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "props"
    ]
    given = [value for call in calls for value in (*call.args, *(keyword.value for keyword in call.keywords))]
    return [ast.unparse(value) for value in given if not _constant(value)]


def _constant(value: ast.expr) -> bool:
    if isinstance(value, ast.IfExp):
        return _constant(value.body) and _constant(value.orelse)
    if isinstance(value, ast.JoinedStr):
        return all(_constant(part.value) for part in value.values if isinstance(part, ast.FormattedValue))
    if isinstance(value, ast.Call):  # of a constant, as list(SHEETS)
        return bool(value.args) and all(_constant(item) for item in value.args)
    return isinstance(value, ast.Constant) or (isinstance(value, ast.Name) and value.id.isupper())


def test_a_quotation_mark_of_a_device_would_be_found() -> None:
    assert put_together("""use.props(f'aria-label="Use {camera.identity}"')""") == [
        """f'aria-label="Use {camera.identity}"'"""
    ]
    assert put_together("""use.props(f'id="{MAIN}"').props("dense", remove="loading" if done else "")""") == []


def test_properties_are_written_out() -> None:
    result = {str(file): put_together(file.read_text()) for file in FILES}
    assert len(result) > 15
    assert {file: arguments for file, arguments in result.items() if arguments} == {}
