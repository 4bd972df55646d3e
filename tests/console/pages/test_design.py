"""Design: what is typed is the probe that is drawn, saved and analysed; any text gives a probe or a message."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.console.pages.simulated import at_console
from tests.waiting import HANGS_S

from tsis.catalog.probes import list_probes, load_probe, parse_probe
from tsis.console.pages.design import LAMP, LAYER, ProbeDraft, QuestionDraft, draft_message, file_name
from tsis.console.widgets import typed_forces
from tsis.errors import InputError
from tsis.present.page import address
from tsis.virtual.planned_probe import DesignQuestion, analyse_designs, compared_designs

if TYPE_CHECKING:
    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument
    from tsis.present.page import Picture


def test_what_is_typed_is_drawn_and_what_is_wrong_is_said_beside_it(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("2 mm of 140 kPa, 3 mm of 80 kPa, 5 mm of 34 kPa, glass; 4 lamps")
        await operator.types("Layer 2, modulus", "60")
        await operator.sees("3 mm of 60 kPa")
        for wrong, message in (
            ("-3", "Modulus must be"),
            ("soft", "Modulus must be a number"),
            ("", "Modulus must be a number"),
        ):
            await operator.types("Layer 2, modulus", wrong)
            await operator.sees(f"Layer 2: {message}", "Not drawn while a field is invalid.", "3 mm of 60 kPa")
        await operator.clicks("Predict performance")
        await operator.hears("Modulus must be a number, as 2 or 0.5 (nothing was entered).")
        await operator.clicks("Save the probe")
        await operator.hears("Modulus must be a number, as 2 or 0.5 (nothing was entered).")
        assert (await operator.requested("/jobs"))["jobs"] == []
        await operator.types("Layer 2, modulus", "70")
        await operator.sees("3 mm of 70 kPa")
        await operator.misses("Not drawn while a field is invalid.")
        await operator.types("Radius of the dome / mm", "11")
        await operator.sees("Radius of the dome must be 12")
        await operator.clicks("Domed")
        await operator.sees("flat; from the tissue up")
        await operator.types("Height / mm", "99")
        await operator.sees("Height of a lamp must be 0–13")
        await operator.types("Height / mm", "4")
        await operator.types("How many", "6.5")
        await operator.sees("Lamps must be a whole number in [1, 36] (you entered 6.5).")
        await operator.types("How many", "6")
        await operator.sees("; 6 lamps")

    at_console(lit, script, "/design")


def test_a_page_that_opens_draws_its_probe_once(lit: Instrument, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[str] = []

    def counted(picture: Picture) -> str:
        drawn.append(picture.alt)
        return address(picture)

    async def script(operator: Operator) -> None:
        await operator.sees("2 mm of 140 kPa, 3 mm of 80 kPa, 5 mm of 34 kPa, glass; 4 lamps")
        await operator.sees("camera stopped")  # the page has gone on meanwhile
        assert 1 <= len(drawn) <= 2  # for its fields, and as it is opened

    monkeypatch.setattr("tsis.console.pages.design.address", counted)
    at_console(lit, script, "/design")


def test_a_wrong_draft_is_marked_after_a_reload(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.types("Layer 2, modulus", "soft")
        await operator.sees("Layer 2: Modulus must be a number")
        await operator.open("/design")
        await operator.sees("Layer 2: Modulus must be a number", "Not drawn while a field is invalid.")
        assert operator.field("Layer 2, modulus") == "soft"

    at_console(lit, script, "/design")


def test_layers_are_added_moved_and_taken_out(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("2 mm of 140 kPa, 3 mm of 80 kPa, 5 mm of 34 kPa, glass")
        await operator.clicks("Add a layer at the glass")
        await operator.sees("5 mm of 34 kPa, 2 mm of 50 kPa, glass")
        await operator.clicks("Move layer 4 to the tissue")
        await operator.sees("2 mm of 50 kPa, 5 mm of 34 kPa, glass")
        await operator.clicks("Move layer 1 to the glass")
        await operator.sees("up 3 mm of 80 kPa, 2 mm of 140 kPa")
        for left in ("up 2 mm of 140 kPa, 2 mm of 50", "up 2 mm of 50 kPa, 5 mm", "up 5 mm of 34 kPa, glass"):
            await operator.clicks("Take layer 1 out")
            await operator.sees(left)
        assert not operator.enabled("Take layer 1 out")

    at_console(lit, script, "/design")


def test_the_saved_probe_is_the_typed_one_and_the_draft_stays_with_the_tab(lit: Instrument) -> None:
    saved: list[str] = []

    async def script(operator: Operator) -> None:
        await operator.sees("Side view")
        await operator.chooses("Start from", "tsis-2011")
        await operator.sees("flat; from the tissue up")
        await operator.types("Layer 1, thickness", "3.5")
        await operator.sees("3.5 mm of")
        await operator.clicks("Save the probe")
        saved.append((await operator.user.download.next(timeout=HANGS_S)).text)
        await operator.clicks("About")
        await operator.sees("Research use only", "Versions")
        await operator.clicks("Design")
        await operator.sees("3.5 mm of")
        assert operator.field("Start from") == "tsis-2011"
        other = await operator.other("/design")
        await other.sees("2 mm of 140 kPa, 3 mm of 80 kPa")

    at_console(lit, script, "/design")
    ((name, entry),) = tomllib.loads(saved[0]).items()
    start = load_probe("tsis-2011")
    layers = (replace(start.layers[0], thickness_mm=3.5), *start.layers[1:])
    assert parse_probe(name, entry) == replace(start, layers=layers, name="tsis-2011 (changed)")


def test_wrong_questions_begin_nothing(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Side view")
        for field, typed, message in (
            ("Forces / N", "0,8", "Force must be"),
            ("Forces / N", "hard", "Force must be a number"),
            ("Forces / N", "1 1 1 1 1 1 1 1 1", "Forces must be at most 8 (you entered 9)."),
            ("Frames of each", "0", "Frames must be 1–"),
            ("Frames of each", "1.5", "Frames must be a whole number (you entered 1.5)."),
        ):
            before = operator.field(field)
            await operator.types(field, typed)
            await operator.sees(message)
            await operator.clicks("Predict performance")
            await operator.hears(message)
            await operator.types(field, before)
        await operator.clicks("Search for better layers and forces (takes minutes)")
        await operator.types("Stacks to try", "0")
        await operator.sees("Stacks to try must be 1–")
        assert (await operator.requested("/jobs"))["jobs"] == []

    at_console(lit, script, "/design")


def test_the_answer_is_that_of_the_library(lit: Instrument) -> None:
    question = DesignQuestion(probe=load_probe("tsis-2011"), forces_n=(0.8,), compared=("reference",))
    expected = analyse_designs(question, compared_designs(question)).designs

    async def script(operator: Operator) -> None:
        await operator.sees("Side view")
        await operator.chooses("Start from", "tsis-2011")
        await operator.types("Forces / N", "0.8")
        for aspect in ("other forces", "more frames of each press"):
            await operator.clicks(aspect)
        await operator.clicks("Predict performance")
        await operator.sees("Save the result")
        rows = operator.texts[operator.texts.index("h / mm") :]
        for design in expected:
            shown = float(rows[rows.index(design.protocol.name) + 2])
            assert shown == pytest.approx(design.information.rmse["depth_mm"], abs=0.005)
        await operator.clicks("Save the result")
        document = json.loads((await operator.user.download.next(timeout=HANGS_S)).text)
        assert [item["name"] for item in document["designs"]] == [design.protocol.name for design in expected]

    at_console(lit, script, "/design")


typed = st.one_of(
    st.text(max_size=12), st.floats().map(str), st.sampled_from(["", "1e999", "-0", "٣", "nan", "0x10", " 5 "])
)


@pytest.mark.parametrize("name", list_probes())
def test_unchanged_fields_are_the_probe_of_the_catalog(name: str) -> None:
    assert ProbeDraft(load_probe(name)).probe() == load_probe(name)
    assert ProbeDraft(load_probe(name)).fault() == ""


@given(text=typed, field=st.sampled_from([*LAYER, *LAMP, "lamps", "radius_mm", "curvature_mm"]))
def test_any_text_gives_a_probe_or_a_message(text: str, field: str) -> None:
    draft = ProbeDraft(load_probe("tsis-domed"))
    if field in LAYER:
        draft.layers[1][field] = text
        beside = draft.layer_fault(draft.layers[1], field)
    elif field in LAMP:
        draft.lamp[field] = text
        beside = draft.lamp_fault(field)
    elif field == "lamps":
        draft.lamps = text
        beside = draft.lamp_fault(field)
    else:
        setattr(draft, field, text)
        beside = draft.face_fault(field)
    message = draft.fault()
    if beside:
        assert message, "what is wrong with a field is wrong with the probe"
    if not message:
        probe = draft.probe()
        assert probe == load_probe("tsis-domed") or probe.name == "tsis-domed (changed)"
    assert "\n" not in message


@given(forces=typed, frames=typed, evaluations=typed)
def test_any_question_is_valid_or_refused_with_a_message(forces: str, frames: str, evaluations: str) -> None:
    draft = QuestionDraft(forces=forces, frames=frames, evaluations=evaluations, search=True)
    message = draft_message(lambda: draft.question(load_probe("tsis-2011")))
    assert "\n" not in message
    if not message:
        question = draft.question(load_probe("tsis-2011"))
        assert 1 <= question.frames_per_press <= 1000
        assert question.evaluations is not None
        assert 1 <= question.evaluations <= 25


def test_forces_are_separated_by_commas_and_spaces() -> None:
    assert typed_forces("0.5, 1;2  3", most=8) == (0.5, 1.0, 2.0, 3.0)
    assert typed_forces(" ", most=8) == ()
    with pytest.raises(InputError, match="at most 8; got 9"):
        typed_forces("1 " * 9, most=8)


def test_names_of_files_have_safe_characters() -> None:
    assert file_name("../a b\\c (changed)") == "a-b-c-changed"
    assert file_name("…") == "probe"
