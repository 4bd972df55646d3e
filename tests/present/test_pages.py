from __future__ import annotations

import io
import re
from contextlib import nullcontext
from dataclasses import replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rich.console import Console
from tests.present.rough_pictures import rough_pictures

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.files.canonical_json import json_bytes
from tsis.imaging.contact import analyse_image
from tsis.inclusion import InclusionPrior
from tsis.model.estimate import Estimate, probability_text
from tsis.model.image import TactileImage
from tsis.present.document import estimate_document, sd_text
from tsis.present.figures import posterior, ring_profile
from tsis.present.html import html_bytes
from tsis.present.images import contact_page, finding_notes
from tsis.present.inclusion import estimate_table, inclusion_cards, inclusion_page
from tsis.present.labels import quantity_of
from tsis.present.terminal import rich_table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes

    from tsis.imaging.profile import RadialProfile

HOSTILE = "<script>alert(1)</script>.png"
TRUTH = {"diameter_mm": 8.0, "depth_mm": 5.0, "young_kpa": 100.0}
VOID = {"meta", "img", "br", "hr", "link", "input"}


class Reader(HTMLParser):
    """Collects tags, texts of pictures and addresses, and checks that every tag is closed."""

    def __init__(self, page: bytes) -> None:
        super().__init__()
        self.opened: list[str] = []
        self.tags: set[str] = set()
        self.alternatives: list[str] = []
        self.sources: list[str] = []
        self.feed(page.decode())
        assert self.opened == []

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.tags.add(tag)
        if tag not in VOID:
            self.opened.append(tag)
        if tag == "img":
            self.alternatives.append(values.get("alt") or "")
            self.sources.append(values.get("src") or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.opened.pop() == tag


def a_press(name: str, bump: float, force_n: float = 1.0) -> TactileImage:
    y, x = np.mgrid[:246, :384]
    grey = 90.0 + bump * np.exp(-((x - 192) ** 2 + (y - 123) ** 2) / 2000.0)
    return TactileImage(grey=grey, mm_per_pixel=(0.0672, 0.0784), force_n=force_n, name=name)


@pytest.fixture
def rough() -> Iterator[None]:
    with rough_pictures():
        yield


@pytest.fixture
def an_estimate() -> Estimate:
    rng = np.random.default_rng(1)
    spread = {"diameter_mm": 0.3, "depth_mm": 0.2, "young_kpa": 15.0}
    samples = {name: rng.normal(TRUTH[name], sd, 500) for name, sd in spread.items()}
    return Estimate(
        samples=samples,
        prior_sd=InclusionPrior().sd,
        cramer_rao_sd={"diameter_mm": 0.25, "depth_mm": 0.125, "young_kpa": float("inf")},
        presence=0.875,
        identifiability="Diameter and depth are told.",
        prior="anything goes",
        flags=("young_kpa_not_identified",),
        notes=(f"A note about {HOSTILE}",),
        provenance={"images": [{"name": HOSTILE}]},
    )


def the_page(estimate: Estimate, reference: TactileImage | None = None, truth: Any = None) -> bytes:
    page = inclusion_page(
        estimate,
        title="A title",
        subtitle=HOSTILE,
        targets=[a_press(HOSTILE, 30.0), a_press("lighter", 20.0, force_n=0.5)],
        references=[] if reference is None else [reference],
        prior=InclusionPrior(),
        ring_edges_mm=np.linspace(0.0, 9.0, 10),
        truth=truth,
    )
    return html_bytes(page)


@pytest.mark.usefixtures("rough")
def test_the_page_shows_interval_truth_and_doubt(an_estimate: Estimate) -> None:
    page = the_page(an_estimate, a_press("plain", 0.0), TRUTH).decode()
    low, high = an_estimate.interval(0.9)["young_kpa"]
    assert f"{low:.3g} to {high:.3g} kPa" in page
    assert "not identified" in page
    assert "truth 8 mm" in page
    assert page.count(RESEARCH_USE_ONLY) >= 2


@pytest.mark.usefixtures("rough")
def test_the_page_shows_presence_prior_and_sd(an_estimate: Estimate) -> None:
    page = the_page(an_estimate).decode()
    assert "<b>0.875</b>" in page
    assert "Probability of an inclusion: 0.875." in page
    assert "Diameter and depth are told." in page
    assert "Prior: anything goes." in page
    assert "least sd without prior" in page
    assert "none known" in page, "no bound is shown where there is none"
    for card in inclusion_cards(an_estimate):
        assert "sd" not in card.detail, "a card has the value and its interval; the table has the rest"


def test_an_estimate_at_an_end_of_the_prior_makes_its_cards_doubtful(an_estimate: Estimate) -> None:
    calm = [card.doubtful for card in inclusion_cards(an_estimate) if "Diameter" in card.title]
    piled = replace(an_estimate, flags=(*an_estimate.flags, "diameter_mm_at_prior_end"))
    assert calm == [False]
    assert all(card.doubtful for card in inclusion_cards(piled))


def test_cards_table_and_figures_have_one_order(an_estimate: Estimate) -> None:
    stored = replace(an_estimate, provenance={"prior": dict.fromkeys(sorted(an_estimate.names), (0.0, 200.0))})
    names = ("diameter_mm", "depth_mm", "young_kpa")
    axes = [quantity_of(name).axis for name in names]
    assert [ax.get_xlabel() for ax in posterior(stored).axes] == axes
    assert [row[0] for row in estimate_table(stored).values] == axes
    assert [card.title for card in inclusion_cards(stored)][: len(names)] == [quantity_of(name).title for name in names]


@pytest.mark.usefixtures("rough")
def test_a_page_that_is_not_to_be_trusted_shows_no_number(an_estimate: Estimate) -> None:
    doubtful = replace(an_estimate, trusted=False, flags=("model_does_not_fit",))
    page = the_page(doubtful).decode()
    assert page.count("<b>not to be trusted</b>") == len(TRUTH) + 1, "the presence too"
    assert "Diameter and depth are told." not in page
    for name, (low, high) in doubtful.untrusted.interval(0.9).items():
        assert f"{low:.3g} to {high:.3g}" not in page
        assert f"{doubtful.untrusted.mean[name]:.3g} " not in page
    table = Console(file=io.StringIO(), width=200)
    table.print(rich_table(estimate_table(doubtful, title="a title", truth=TRUTH)))
    assert isinstance(table.file, io.StringIO)
    printed = table.file.getvalue()
    assert printed.count("not to be trusted") == len(TRUTH)
    assert f"{doubtful.untrusted.mean['depth_mm']:.3g}" not in re.sub(rf"{TRUTH['depth_mm']:.4g} *\n", "", printed)


@pytest.mark.usefixtures("rough")
def test_the_strongest_press_is_shown_and_every_profile(an_estimate: Estimate, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[str] = []
    real = ring_profile

    def note(profile: RadialProfile, ax: Axes, *, label: str = "", marker: str = "o") -> Axes:
        drawn.append(label)
        return real(profile, ax, label=label, marker=marker)

    monkeypatch.setattr("tsis.present.images.ring_profile", note)
    read = Reader(the_page(an_estimate, a_press("plain", 0.0, force_n=0.75)))
    assert drawn == ["target, 1 N", "target, 0.5 N", "plain tissue, 0.75 N"]
    assert sum(HOSTILE in text for text in read.alternatives) == 1


@pytest.mark.parametrize("with_reference", [True, False])
def test_pages_are_whole_and_safe(an_estimate: Estimate, with_reference: bool) -> None:
    with nullcontext() if with_reference else rough_pictures():
        page = the_page(an_estimate, a_press("plain", 0.0) if with_reference else None)
    read = Reader(page)
    assert "script" not in read.tags
    assert "&lt;script&gt;" in page.decode()
    assert all(read.alternatives)
    assert all(source.startswith("data:image/") for source in read.sources)
    assert not re.search(r"(?:src|href)=[\"']?https?:", page.decode())


def test_a_contact_page_of_hostile_names_is_safe() -> None:
    finding = analyse_image(a_press(HOSTILE, 40.0), a_press("untouched", 0.0), invert=False)
    contact = contact_page([finding], provenance={"a": [{"b": HOSTILE}]})
    contact = replace(contact, refused=(("force", "needs <b>something</b>"),))
    page = html_bytes(contact)
    read = Reader(page)
    assert "script" not in read.tags
    assert "needs &lt;b&gt;something&lt;/b&gt;" in page.decode()
    assert len(read.alternatives) == 3


def test_equal_results_give_equal_pages(an_estimate: Estimate) -> None:
    assert the_page(an_estimate) == the_page(an_estimate)


def test_the_document_holds_the_numbers(an_estimate: Estimate) -> None:
    document = estimate_document(an_estimate, TRUTH)
    depth = document["parameters"]["depth_mm"]
    samples = an_estimate.samples["depth_mm"]
    assert depth["mean"] == pytest.approx(np.mean(samples))
    assert depth["interval_90"] == pytest.approx(np.percentile(samples, [5, 95]))
    assert depth["truth"] == 5.0
    assert document["flags"] == ["young_kpa_not_identified"]
    assert depth["cramer_rao_sd"] == 0.125
    assert document["parameters"]["young_kpa"]["cramer_rao_sd"] is None, "JSON has no infinity"
    assert (document["presence"], document["trusted"]) == (0.875, True)


def test_nan_never_reaches_a_file() -> None:
    with pytest.raises(ValueError, match="Out of range float values"):
        json_bytes({"value": float("nan")})


@pytest.mark.parametrize(("value", "words"), [(0.05642, "0.056"), (99.4, "99"), (159.8, "160"), (1e9, "1e+09")])
def test_a_spread_has_two_digits(value: float, words: str) -> None:
    assert sd_text(value) == words


@pytest.mark.parametrize(
    ("value", "words"),
    [(1.0, "above 0.999"), (0.99905, "above 0.999"), (0.97512, "0.975"), (1e-9, "below 0.001"), (0.002, "0.002")],
)
def test_no_probability_is_shown_as_certain(value: float, words: str) -> None:
    assert probability_text(value) == words


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("invert", [False, True])
def test_light_that_changes_the_other_way_is_noted(sign: int, *, invert: bool) -> None:
    """A disc of 60 grey levels in a ring of 20 of the other sign, read either way."""
    y, x = np.mgrid[:246, :384]
    radius = np.hypot(x - 192, y - 123)
    change = sign * (60.0 * (radius < 30) - 20.0 * ((radius >= 30) & (radius < 60)))
    untouched = TactileImage(grey=np.full(change.shape, 120.0))
    finding = analyse_image(TactileImage(grey=untouched.grey + change, name="press"), untouched, invert=invert)
    wrong = (sign > 0) == invert
    assert ("by 60 against 20 grey levels" in " ".join(finding_notes(finding))) == wrong
