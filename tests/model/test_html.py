"""The summaries that notebooks show: small, self-contained, escaped, and without withheld numbers."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image
from tests.model.test_content import calibration, disc, estimate

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.calibration.frames import UsableCalibration
from tsis.model.estimate import Estimate

if TYPE_CHECKING:
    from collections.abc import Callable

HOSTILE = "<script>alert('1')</script>&\"x"
RESPONSE = tsis.model.calibration.Calibration(gain_grey_per_kpa=1.25, saturation_kpa=80.0)


class Strict(HTMLParser):
    """Collects texts and tags, and checks that tags are closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.texts: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        for name, value in attrs:
            assert name in ("style", "alt", "src")
            assert name != "src" or (value or "").startswith("data:image/png;base64,")
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


HOSTILE_VALUES: dict[str, Callable[[], str]] = {
    "image": lambda: replace(disc(), name=HOSTILE)._repr_html_(),
    "estimate": lambda: replace(estimate(), flags=(HOSTILE,))._repr_html_(),
    "response": lambda: replace(RESPONSE, name=HOSTILE, probe=HOSTILE)._repr_html_(),
    "calibration": lambda: replace(calibration(), name=HOSTILE, camera=HOSTILE)._repr_html_(),
    "usable": lambda: UsableCalibration(
        calibration=replace(calibration(), name=HOSTILE), identity="0" * 64
    )._repr_html_(),
    "probe": lambda: replace(tsis.load_probe("tsis-2011"), name=HOSTILE, assumed=(HOSTILE,))._repr_html_(),
}


@pytest.mark.parametrize("name", HOSTILE_VALUES)
def test_every_text_is_escaped_and_nothing_is_loaded(name: str) -> None:
    text = HOSTILE_VALUES[name]()
    page = Strict(text)
    assert "<script" not in text
    assert HOSTILE in page.texts
    assert page.tags <= {"div", "p", "strong", "table", "tr", "th", "td", "img"}
    assert len(text) < 100_000
    assert (RESEARCH_USE_ONLY in text) == (name == "estimate")


def test_an_image_shows_its_picture_and_numbers() -> None:
    image = disc()
    text = image._repr_html_()
    (data,) = re.findall(r"base64,([^\"]+)", text)
    with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
        np.testing.assert_array_equal(np.asarray(picture), image.grey.astype(np.uint8))
    assert {"80 x 60", "0.1 x 0.2", "0.5 N"} <= set(Strict(text).texts)


def test_a_large_image_stays_small() -> None:
    grey = np.random.default_rng(0).uniform(0, 65535, size=(3000, 4001))
    text = tsis.TactileImage(grey=grey, full_scale=65535.0)._repr_html_()
    (data,) = re.findall(r"base64,([^\"]+)", text)
    with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
        assert max(picture.size) <= 240
        assert np.asarray(picture).mean() == pytest.approx(127, abs=3)
    assert len(text) < 100_000


def test_an_estimate_shows_what_its_report_shows() -> None:
    result = replace(estimate(), flags=("depth_mm_not_identified",))
    low, high = np.quantile(result.samples["diameter_mm"], [0.05, 0.95])
    cells = Strict(result._repr_html_()).texts
    assert f"{np.mean(result.samples['diameter_mm']):.3g}" in cells
    assert f"{low:.3g} to {high:.3g}" in cells
    assert "not identified" in cells
    assert f"{np.mean(result.samples['depth_mm']):.4g}" not in cells


@pytest.mark.parametrize(("presence", "says"), [(0.99999, "above 0.999"), (1e-9, "below 0.001"), (0.5, "0.5")])
def test_a_probability_is_never_0_or_1(presence: float, says: str) -> None:
    assert says in Strict(replace(estimate(), presence=presence)._repr_html_()).texts


def test_an_untrusted_estimate_shows_no_number() -> None:
    draws = np.linspace(7.7710, 7.7711, 50)
    result = Estimate(
        samples={"diameter_mm": draws, "depth_mm": draws},
        prior_sd={"diameter_mm": 4.0, "depth_mm": 2.0},
        presence=0.77712,
        identifiability="Diameter 7.771 mm.",
        notes=("Its diameter is 7.771 mm.",),
        trusted=False,
        flags=("misfit",),
    )
    texts = " ".join(Strict(result._repr_html_()).texts).replace("90 %", "")
    assert not re.search(r"\d", texts)
    assert texts.count("not to be trusted") == 2
    assert "misfit" in texts


def test_a_probe_lists_its_layers_from_the_tissue_up() -> None:
    probe = tsis.load_probe("tsis-2011")
    cells = Strict(probe._repr_html_()).texts
    for number, layer in enumerate(probe.layers, start=1):
        row = cells[cells.index(f"layer {number}") + 1]
        assert row.startswith(f"{layer.thickness_mm:g} mm, {layer.young_kpa:g} kPa")
