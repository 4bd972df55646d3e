"""Designs as documents and pages: the same numbers as the designs themselves, in the order of the question."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from tsis.catalog.probes import load_probe
from tsis.errors import InputError
from tsis.files.canonical_json import json_bytes
from tsis.inclusion import InclusionPrior
from tsis.inclusion.design.alternatives import compare_designs
from tsis.inclusion.design.protocol import protocol_of
from tsis.present.design import HEADINGS, design_document, design_page, design_rows
from tsis.virtual.planned_probe import (
    DesignAnalysis,
    DesignQuestion,
    analyse_designs,
    compared_designs,
    design_calibration,
)

QUESTION = DesignQuestion(
    probe=load_probe("tsis-2011"), forces_n=(0.8,), compared=("reference", "frames"), criterion="depth_mm"
)


@pytest.fixture(scope="module")
def answer() -> DesignAnalysis:
    return analyse_designs(QUESTION, compared_designs(QUESTION))


def test_designs_come_in_the_order_of_the_criterion(answer: DesignAnalysis) -> None:
    names = [one.protocol.name for one in answer.designs]
    assert set(names) == {"as planned", "without a reference", "frames of each press: 4", "frames of each press: 16"}
    errors = [one.information.rmse["depth_mm"] for one in answer.designs]
    assert errors == sorted(errors)
    assert answer.best is answer.designs[0]


def test_the_planned_design_is_that_of_the_library(answer: DesignAnalysis) -> None:
    once = protocol_of(load_probe("tsis-2011"), (0.8,))
    (alone,) = compare_designs([once], of=once.probe, prior=InclusionPrior(), calibration=design_calibration())
    assert answer.planned.information.rmse == pytest.approx(alone.information.rmse)


def test_the_page_says_what_the_designs_say(answer: DesignAnalysis) -> None:
    page = design_page(answer)
    (table,) = page.tables
    assert table.headings == HEADINGS
    for row, one in zip(table.rows, answer.designs, strict=True):
        assert row[0] == one.protocol.name
        assert float(row[1]) == pytest.approx(one.information.rmse["diameter_mm"], abs=0.005)
        assert float(row[3]) == pytest.approx(one.information.rmse["young_kpa"], abs=0.05)
        assert row[-1] == ", ".join(one.limits.broken)
    error = answer.planned.information.rmse["depth_mm"]
    depth = next(card for card in page.cards if card.title.startswith("Depth"))
    assert depth.value == f"± {error:.2f} mm"
    assert depth.detail == "before any press ± 2.31 mm", "the prior of the documentation"
    assert page.cards[-1].value == answer.best.protocol.name
    figure = Figure()
    page.pictures[0].draw(figure)
    points = [line for line in figure.axes[0].lines if len(line.get_xdata()) == 1]  # type: ignore[arg-type]
    assert len(points) == len(answer.designs)


def test_a_document_is_json_with_every_design(answer: DesignAnalysis) -> None:
    document = design_document(answer)
    assert json_bytes(document)
    assert [row[0] for row in design_rows(answer.designs)] == [one["name"] for one in document["designs"]]
    assert document["planned"]["presses"][0]["force_n"] == 0.8


def test_a_broken_limit_is_said_in_words() -> None:
    question = DesignQuestion(probe=load_probe("tsis-2011"), forces_n=(5.0,), compared=())
    page = design_page(analyse_designs(question, compared_designs(question)))
    assert any("press less" in note for note in page.notes)
    assert all(card.doubtful for card in page.cards)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"forces_n": (-1.0,)}, "force_n must lie in"),
        ({"frames_per_press": 0}, "frames_each must lie in"),
        ({"compared": ("colour",)}, "no aspect is called 'colour'"),
        ({"criterion": "price"}, "no criterion is called 'price'"),
        ({"evaluations": 26}, "evaluations must lie in"),
    ],
)
def test_a_wrong_question_is_refused_in_a_sentence(wrong: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence.replace("(", r"\(")):
        DesignQuestion(probe=load_probe("tsis-2011"), **wrong)  # type: ignore[arg-type]


def test_forces_are_those_of_the_face_when_nobody_says() -> None:
    assert DesignQuestion(probe=load_probe("tsis-domed")).planned.forces_n == (0.5, 1.0)
    assert DesignQuestion(probe=load_probe("tsis-2011")).planned.forces_n == (1.0,)
