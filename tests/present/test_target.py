from __future__ import annotations

import re
from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.present.pdf_readers import sheets
from tests.present.test_pages import HOSTILE, Reader
from tests.records.sample import WHEN, sample_estimate, sample_record
from tests.records.variants import SECRETS, named

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.calibration.guard.limits import GUARD_FLAGS
from tsis.errors import RecordsError
from tsis.model.estimate import Estimate
from tsis.present.html import html_bytes
from tsis.present.pdf import pdf_bytes
from tsis.present.target import target_page
from tsis.records.values import StoredEstimate, TargetRecord

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.present.page import Page, Table


def words(page: Page) -> str:
    """All texts of a page."""
    cards = [f"{card.title} {card.value} {card.detail}" for card in page.cards]
    pictures = [f"{picture.title} {picture.alt} {picture.caption}" for picture in page.pictures]
    rows = [" ".join(row) for table in page.tables for row in (table.headings, *table.rows)]
    return "\n".join([page.title, page.subtitle, *cards, *page.notes, *pictures, *rows, str(page.provenance)])


def table(page: Page, title: str) -> Table:
    (found,) = (each for each in page.tables if each.title.startswith(title))
    return found


def pictures(page: Page) -> list[str]:
    return [picture.title for picture in page.pictures]


def other_presses(dossier: TargetRecord, **changes: Any) -> TargetRecord:
    return replace(dossier, presses=tuple(replace(press, **changes) for press in dossier.presses))


def test_the_estimate_in_force_stands_beside_the_truth() -> None:
    record = sample_record()
    page = target_page(record)
    estimate = record.estimates[0].estimate
    rows = {row[0]: row[1:] for row in table(page, "Current estimate").rows}
    low, high = estimate.interval(0.9)["depth_mm"]
    assert rows["depth h / mm"][:2] == (f"{np.mean(estimate.samples['depth_mm']):.3g}", f"{low:.3g} to {high:.3g}")
    assert rows["depth h / mm"][-1] == "5"
    assert rows["modulus E / kPa"][0] == "not identified"
    assert [card.title for card in page.cards] == ["Diameter d", "Depth h", "Modulus E", "Is there an inclusion?"]
    assert "truth 80 kPa" in page.cards[2].detail
    assert pictures(page) == [
        "Posterior of each parameter",
        "Which parameters trade off",
        "Tactile image",
        "What the inclusion adds",
        "Surface",
        "The profiles that the estimate rests on",
        "Every frame",
    ]


def test_every_press_is_told_and_its_flag_explained() -> None:
    record = sample_record()
    page = target_page(record)
    rows = table(page, "Presses").rows
    assert [row[1] for row in rows] == [f"2026-11-22 09:{30 + i // 3}:{20 * i % 60:02d}" for i in range(4)]
    assert [row[6] for row in rows] == [press.frame[:12] for press in record.presses]
    assert rows[1][2:6] == ("target", "1 N", "0.12 × 0.14", "moving")
    assert f"Press 2 is flagged moving: {GUARD_FLAGS['moving'].means}." in page.notes
    assert all(press.frame in str(page.provenance) for press in record.presses), "whole hashes"
    odd = target_page(other_presses(record, flags=("mine",)))
    assert any(
        note.startswith("Presses 1, 2, 3 and 4 are flagged mine: no flag of the press guard") for note in odd.notes
    )


def test_the_strongest_press_is_shown_against_the_nearest_on_plain_tissue() -> None:
    shown = {picture.title: picture.caption for picture in target_page(sample_record()).pictures}
    assert shown["Tactile image"].startswith("target-1N.png, 1 N.")
    assert shown["What the inclusion adds"].startswith("target-1N.png minus plain-1N.png")


def test_history_goes_from_the_first_to_the_one_in_force() -> None:
    record = sample_record()
    first = record.estimates[0]
    distrusted = replace(first, id="estimate-b", supersedes="estimate-a", estimate=sample_estimate(trusted=False))
    page = target_page(replace(record, estimates=(first, distrusted)))
    rows = table(page, "All estimates").rows
    assert [row[1] for row in rows] == ["estimate-a", "estimate-b"]
    low, high = first.estimate.interval(0.9)["diameter_mm"]
    assert f"Diameter d {first.estimate.mean['diameter_mm']:.3g} mm ({low:.3g} to {high:.3g})" in rows[0][4]
    assert rows[1][4:] == ("not to be trusted", "4", "estimate-a")


def test_what_is_not_to_be_trusted_shows_no_number() -> None:
    record = sample_record()
    stored = replace(record.estimates[0], estimate=sample_estimate(trusted=False))
    page = target_page(replace(record, estimates=(stored,)))
    said = words(page)
    for name, (low, high) in stored.estimate.untrusted.interval(0.9).items():
        assert f"{low:.3g} to {high:.3g}" not in said
        assert f"{stored.estimate.untrusted.mean[name]:.3g} " not in said
    assert [card.value for card in page.cards[:3]] == ["not to be trusted"] * 3
    assert "Posterior of each parameter" not in pictures(page)
    assert [row[1] for row in table(page, "Current estimate").rows] == ["not to be trusted"] * 3


def unreadable(name: str) -> NDArray[Any]:
    raise RecordsError(f"frame {name[:4]} must be what was stored; got other bytes (restore it from a copy)")


def poor_dossiers() -> dict[str, TargetRecord]:
    """Targets of which much is not known."""
    whole = sample_record(estimated=False)
    bare = other_presses(whole, mm_per_pixel=None, force_n=None, calibration=None, probe="", name="")
    untouched = replace(bare.presses[0], role="untouched")
    return {
        "no estimate": whole,
        "no scale": replace(bare, calibrations={}),
        "one untouched": replace(bare, presses=(untouched,), calibrations={}),
        "nothing": replace(bare, presses=(), calibrations={}),
        "unreadable": replace(sample_record(), read=unreadable),
    }


@pytest.mark.parametrize(
    ("case", "shown", "said"),
    [
        ("no estimate", ["Tactile image", "What the inclusion adds", "Surface", "Profiles", "Every frame"], "none yet"),
        ("no scale", ["Tactile image", "What the inclusion adds", "Every frame"], "without a measured force"),
        ("one untouched", ["Tactile image"], "Press 1 is without a scale"),
        ("nothing", [], "Nothing was recorded yet."),
        (
            "unreadable",
            ["Posterior of each parameter", "Which parameters trade off"],
            "The frame of press 4 cannot be shown",
        ),
    ],
)
def test_a_target_of_which_little_is_known_has_a_page(case: str, shown: list[str], said: str) -> None:
    page = target_page(poor_dossiers()[case])
    assert pictures(page) == shown
    assert said in words(page)


@pytest.mark.parametrize("case", ["no scale", "nothing", "unreadable"])
def test_what_little_is_known_is_drawn_on_paper(case: str) -> None:
    assert pdf_bytes(target_page(poor_dossiers()[case])).startswith(b"%PDF-")


def test_a_probe_that_the_catalog_lacks_has_no_rings() -> None:
    record = sample_record()
    page = target_page(replace(record, estimates=(replace(record.estimates[0], probe="mine"),)))
    assert "The profiles that the estimate rests on" not in pictures(page)
    assert "Profiles in rings are left out: the catalog has no probe mine." in page.notes


def test_another_kind_of_prior_is_not_drawn_as_ours() -> None:
    record = sample_record()
    odd = replace(record.estimates[0], options={"prior": {"of_another_kind": 1.0}})
    page = target_page(replace(record, estimates=(odd,)))
    assert "Posterior of each parameter" not in pictures(page)
    assert any("prior" in note and "draw" in note for note in page.notes)


@pytest.mark.parametrize("known_from", ["options", "provenance"])
def test_the_prior_that_was_used_is_drawn(known_from: str) -> None:
    record = sample_record()
    stored, prior = record.estimates[0], {"prior": {"depth_mm": [4.0, 9.0]}}
    own = (
        replace(stored, options=prior)
        if known_from == "options"
        else replace(stored, options={}, estimate=replace(stored.estimate, provenance=prior))
    )
    (shown, *_) = target_page(replace(record, estimates=(own,))).pictures
    figure = Figure()
    shown.draw(figure)
    low, high = figure.axes[1].get_xlim()
    assert (low, high) == pytest.approx((4.0, 9.0), abs=0.2)


def hardness_dossier() -> TargetRecord:
    record = sample_record()
    estimate = Estimate(
        samples={"young_kpa": np.random.default_rng(0).normal(300, 20, 400)},
        prior_sd={"young_kpa": 100.0},
        identifiability="The modulus is identified.",
        prior="wide",
    )
    stored = StoredEstimate(
        kind="hardness",
        estimate=estimate,
        made=WHEN,
        probe="tsis-2011",
        presses=tuple(press.id for press in record.presses[:2]),
        calibration="0" * 64,
        id="estimate-h",
    )
    untouched = tuple(replace(press, role="untouched", force_n=None) for press in record.presses[2:])
    return replace(record, presses=(*record.presses[:2], *untouched), estimates=(stored,))


def test_an_object_shows_its_hardness() -> None:
    page = target_page(hardness_dossier())
    assert page.cards[0].title == "Young's modulus"
    assert "truth 80 kPa" in page.cards[0].detail
    assert pictures(page)[:3] == ["Modulus", "Tactile image", "What the touch changed"]
    assert "The estimate does not rest on 2 other presses of this target." in page.notes
    assert ("truth of Diameter d", "10 mm") in table(page, "Current estimate").rows


def test_a_subject_is_a_pseudonym_and_nothing_else() -> None:
    given = named("subject")
    page = target_page(replace(given, target=replace(given.target, name="S-017")))
    for shown in (words(page), html_bytes(page).decode()):
        for secret in SECRETS:
            # "label" is a word of the page's own drawings.
            assert secret == "label" or secret.casefold() not in shown.casefold(), secret
        assert "S-017" in shown
        assert "other probe" in shown
        assert "other flag" in shown
        assert "Press 1 is flagged" not in shown
        assert "moving" in shown
        assert "off_axis: the inclusion lies too far" in shown
        assert "shows only the pseudonym" in shown
        assert "0" * 64 in shown
    assert "truth" not in words(page)
    assert given.presses[0].calibration is not None
    assert given.presses[0].calibration[:12] in words(page)


def test_names_of_digits_change_no_number_of_a_subject() -> None:
    whole = sample_record(kind="subject")
    renamed = tuple(replace(press, name=name) for press, name in zip(whole.presses, "192p", strict=True))
    result, plain = (target_page(each) for each in (replace(whole, presses=renamed), whole))
    assert result.notes == plain.notes
    low, high = whole.estimates[0].estimate.interval(0.9)["diameter_mm"]
    assert any(f"The diameter lies between {low:.3g} and {high:.3g} mm" in note for note in result.notes)


def test_both_kinds_of_estimate_are_in_force() -> None:
    record = sample_record()
    (hard,) = hardness_dossier().estimates
    first = replace(record.estimates[0], id="estimate-0", estimate=sample_estimate(trusted=False))
    page = target_page(replace(record, estimates=(first, *record.estimates, hard)))
    assert [card.title for card in page.cards] == [
        *(f"{what} (inclusion)" for what in ("Diameter d", "Depth h", "Modulus E", "Is there an inclusion?")),
        "Young's modulus (hardness)",
    ]
    assert table(page, "Current estimate (hardness)").rows[0][0] == "Young's modulus"
    assert table(page, "Current estimate (inclusion)").rows[0][0] == "diameter d / mm"
    assert {"Modulus", "Posterior of each parameter"} <= set(pictures(page))
    assert "Of the hardness: The modulus is identified." in page.notes
    assert str(page.provenance).count("'supersedes'") == 2
    newer = replace(hard, made=WHEN + timedelta(hours=1))
    assert target_page(replace(record, estimates=(*record.estimates, newer))).cards[0].title.startswith("Young")


def hostile_dossier() -> TargetRecord:
    record = sample_record()
    stored = record.estimates[0]
    estimate = replace(stored.estimate, notes=(HOSTILE,), provenance={HOSTILE: [{HOSTILE: HOSTILE}]})
    return replace(
        other_presses(record, name=HOSTILE, note=HOSTILE, flags=(HOSTILE,), settings={HOSTILE: HOSTILE}),
        target=replace(record.target, name=HOSTILE, note=HOSTILE),
        estimates=(replace(stored, estimate=estimate, id=HOSTILE, supersedes=HOSTILE, environment={"tsis": HOSTILE}),),
    )


@pytest.mark.slow
def test_hostile_names_do_no_harm() -> None:
    page = target_page(hostile_dossier())
    content = html_bytes(page)
    read = Reader(content)
    assert "script" not in read.tags
    assert all(read.alternatives)
    assert all(source.startswith("data:image/") for source in read.sources)
    assert not re.search(r"(?:src|href)=[\"']?https?:", content.decode())
    assert content.decode().count(RESEARCH_USE_ONLY) >= 2
    named = tuple(picture for picture in page.pictures if HOSTILE in f"{picture.title} {picture.alt} {picture.caption}")
    assert named
    assert pdf_bytes(replace(page, pictures=named)).startswith(b"%PDF-")


@pytest.mark.system
def test_paper_and_screen_tell_the_same(tmp_path: Path) -> None:
    page = target_page(sample_record())
    read = sheets(pdf_bytes(page), tmp_path)
    assert 2 <= len(read) <= 4
    close = "".join(read).replace(" ", "")
    for each in page.tables:
        assert each.title.replace(" ", "") in close
        for row in each.rows:
            for cell in row:
                assert all(part in close for part in cell.split()), cell
    for card in page.cards:
        assert card.value.replace(" ", "") in close
    for press in sample_record().presses:
        assert press.frame in close


@pytest.mark.parametrize("kind", ["phantom", "subject"])
def test_an_estimate_whose_presses_were_edited_since_is_told_first(kind: str) -> None:
    record = sample_record(kind=kind)
    (stored,) = record.estimates
    told = {
        name: [{"name": press.name, "force_n": press.force_n} for press in record.presses if press.role == role]
        for name, role in (("images", "target"), ("reference", "plain"))
    }
    record = replace(record, estimates=(replace(stored, estimate=replace(stored.estimate, provenance=told)),))
    assert "have changed since" not in words(target_page(record))
    first, second, *others = record.presses
    record = replace(record, presses=(first, replace(second, force_n=1.2, version=2), *others))
    assert target_page(record).notes[0] == (
        "The presses have changed since the inclusion was estimated: force_n 1 -> 1.2 of press 2; make it again with "
        "tsis records recompute 3."
    )
