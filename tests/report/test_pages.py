from __future__ import annotations

import re
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis import Estimate, TactileImage
from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.inclusion import InclusionPrior
from tsis.report import contact_report, inclusion_report
from tsis.report.contact import find
from tsis.report.document import estimate_document, json_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence

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


def a_press(name: str, bump: float) -> TactileImage:
    y, x = np.mgrid[:246, :384]
    grey = 90.0 + bump * np.exp(-((x - 192) ** 2 + (y - 123) ** 2) / 2000.0)
    return TactileImage(grey=grey, mm_per_pixel=(0.0672, 0.0784), force_n=1.0, name=name)


@pytest.fixture
def an_estimate() -> Estimate:
    rng = np.random.default_rng(1)
    spread = {"diameter_mm": 0.3, "depth_mm": 0.2, "young_kpa": 15.0}
    samples = {name: rng.normal(TRUTH[name], sd, 500) for name, sd in spread.items()}
    return Estimate(
        samples=samples,
        prior_sd=InclusionPrior().sd,
        flags=("young_kpa_not_identified",),
        notes=(f"A note about {HOSTILE}",),
        provenance={"images": [{"name": HOSTILE}]},
    )


def the_page(estimate: Estimate, reference: TactileImage | None = None, truth: Any = None) -> bytes:
    return inclusion_report(
        estimate,
        title="A title",
        subtitle=HOSTILE,
        target=a_press(HOSTILE, 30.0),
        reference=reference,
        prior=InclusionPrior(),
        ring_edges_mm=np.linspace(0.0, 9.0, 10),
        truth=truth,
    )


def test_the_page_shows_interval_truth_and_doubt(an_estimate: Estimate) -> None:
    page = the_page(an_estimate, a_press("plain", 0.0), TRUTH).decode()
    low, high = an_estimate.interval(0.9)["young_kpa"]
    assert f"{low:.3g} to {high:.3g} kPa" in page
    assert "not identified" in page
    assert "truth 8 mm" in page
    assert page.count(RESEARCH_USE_ONLY) >= 2


@pytest.mark.parametrize("with_reference", [True, False])
def test_pages_are_whole_and_safe(an_estimate: Estimate, with_reference: bool) -> None:
    page = the_page(an_estimate, a_press("plain", 0.0) if with_reference else None)
    read = Reader(page)
    assert "script" not in read.tags
    assert "&lt;script&gt;" in page.decode()
    assert all(read.alternatives)
    assert all(source.startswith("data:image/") for source in read.sources)
    assert not re.search(r"(?:src|href)=[\"']?https?:", page.decode())


def test_a_contact_page_of_hostile_names_is_safe() -> None:
    finding = find(a_press(HOSTILE, 40.0), a_press("untouched", 0.0), invert=False)
    page = contact_report([finding], refused=[("force", "needs <b>something</b>")], provenance={"a": [{"b": HOSTILE}]})
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


def test_nan_never_reaches_a_file() -> None:
    with pytest.raises(ValueError, match="Out of range float values"):
        json_bytes({"value": float("nan")})
