"""Drafts of the page Design without a browser: any text gives a probe or a message."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.catalog.probes import list_probes, load_probe
from tsis.console.pages.design import LAMP, LAYER, ProbeDraft, QuestionDraft, draft_message, file_name
from tsis.console.widgets import typed_forces
from tsis.errors import InputError

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
