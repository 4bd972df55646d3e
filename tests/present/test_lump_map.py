"""Page, document and volumes of a map, made up without any estimate."""

from __future__ import annotations

import base64
import json
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.mapping.lump_map import Lump, LumpMap, MapNumbers, NextPlace
from tsis.model.estimate import Estimate
from tsis.present.html import html_bytes
from tsis.present.lump_map import (
    VOLUMES,
    guide_page,
    lump_balls,
    lump_map_document,
    lump_map_page,
    nifti_files,
    vtk_bytes,
)

if TYPE_CHECKING:
    from pathlib import Path


X, Y, DEPTH = np.arange(-10.0, 11.0, 2.0), np.arange(-6.0, 7.0, 2.0), np.arange(1.0, 20.0, 2.0)
MIDDLE = {"x_mm": 4.0, "y_mm": -2.0, "centre_depth_mm": 9.0, "depth_mm": 5.0, "diameter_mm": 8.0, "contrast": 6.0}


def estimate_of(rng: np.random.Generator, middle: dict[str, float]) -> Estimate:
    samples = {name: value * (1 + 0.01 * rng.normal(size=400)) for name, value in middle.items()}
    return Estimate(samples=samples, prior_sd=dict.fromkeys(samples, 5.0))


def map_of(seed: int) -> LumpMap:
    rng = np.random.default_rng(seed)
    shape = (len(DEPTH), len(Y), len(X))
    lump = Lump(name="lump 1", probability=0.97, estimate=estimate_of(rng, {**MIDDLE, "young_kpa": 30.0}))
    numbers = MapNumbers(
        x_mm=X,
        y_mm=Y,
        depth_mm=DEPTH,
        probability=rng.uniform(size=shape),
        area_probability=rng.uniform(size=shape[1:]),
        area_mm=5.0,
        modulus_kpa=rng.uniform(4.0, 6.0, size=shape),
        modulus_sd_kpa=rng.uniform(0.1, 0.2, size=shape),
        count_probability=np.array([0.02, 0.95, 0.03]),
        lumps=(lump,),
        unevenness=estimate_of(rng, {"sd": 0.1, "length_mm": 5.0}),
        blind_diameter_mm=np.where(rng.uniform(size=shape) < 0.1, np.inf, 6.0),
        next_places=(NextPlace(x_mm=8.0, y_mm=4.0, gain_nats=0.3),),
    )
    places = np.array([[0.0, 0.0], [10.0, 0.0]])
    return LumpMap(untrusted=numbers, places_mm=places, place_shift_mm=np.zeros_like(places))


def test_the_volumes_of_nifti_lie_where_the_map_says() -> None:
    nibabel = pytest.importorskip("nibabel", reason="the extra map is not installed")
    found = map_of(11)
    for name in VOLUMES:
        image = nibabel.Nifti1Image.from_bytes(nifti_files(found.numbers)[f"{name.replace('_', '-')}.nii"])
        values = image.get_fdata()
        at = (7, 2, 4)
        x, y, z = nibabel.affines.apply_affine(image.affine, at)
        here = getattr(found.numbers, name)[
            np.flatnonzero(-z == DEPTH)[0], np.flatnonzero(y == Y)[0], np.flatnonzero(x == X)[0]
        ]
        assert values[at] == here
        assert values.shape == (len(X), len(Y), len(DEPTH))


def test_the_volumes_of_vtk_hold_the_numbers_in_its_order() -> None:
    found = map_of(12)
    image = ET.fromstring(vtk_bytes(found.numbers)).find("ImageData")
    assert image is not None
    assert image.attrib["WholeExtent"] == "0 10 0 6 0 9"
    assert [float(word) for word in image.attrib["Origin"].split()] == [-10.0, -6.0, -19.0]
    assert [float(word) for word in image.attrib["Spacing"].split()] == [2.0, 2.0, 2.0]
    blocks = {block.attrib["Name"]: block.text or "" for block in image.iter("DataArray")}
    for name in VOLUMES:
        content = base64.b64decode(blocks[name])
        assert int.from_bytes(content[:8], "little") == len(content) - 8
        values = np.frombuffer(content[8:])
        assert values[3 + len(X) * (2 + len(Y) * 4)] == getattr(found.numbers, name)[len(DEPTH) - 1 - 4, 2, 3]


def test_pyvista_reads_the_volumes(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista", reason="pyvista is not installed")
    found = map_of(13)
    file = tmp_path / "map.vti"
    file.write_bytes(vtk_bytes(found.numbers))
    grid = pyvista.read(file)
    point = grid.find_closest_point((4.0, -2.0, -9.0))
    assert grid["probability"][point] == found.numbers.probability[4, 2, 7]


def test_page_and_document_show_the_lumps_of_a_trusted_map() -> None:
    found = map_of(14)
    document = json.loads(json.dumps(lump_map_document(found)))
    low, high = document["lumps"][0]["estimate"]["parameters"]["diameter_mm"]["interval_90"]
    assert low < 8.0 < high
    page = lump_map_page(found, title="Map", subtitle="two presses")
    text = html_bytes(page).decode()
    parts = ("Lumps, 90 % intervals", "lump 1", "Where to press next", "Modulus", "Blind zone", "Research use only")
    assert [part for part in parts if part not in text] == []
    without = replace(found, untrusted=replace(found.untrusted, lumps=()))
    assert "Lumps, 90 % intervals" not in html_bytes(lump_map_page(without, title="Map", subtitle="")).decode()


def test_an_untrusted_map_shows_no_number() -> None:
    found = replace(map_of(15), trusted=False, flags=("map_does_not_fit",), notes=("The map does not fit.",))
    document = lump_map_document(found)
    assert [document[name] for name in ("lumps", "count_probability", "unevenness", "next_places")] == [None] * 4
    page = lump_map_page(found, title="Map", subtitle="two presses")
    assert [table.title for table in page.tables] == ["Flags"]
    assert page.pictures == ()
    assert page.cards[0].value == "withheld"


def test_a_contrast_that_cannot_be_told_is_a_bound() -> None:
    found = map_of(16)
    lump = replace(found.untrusted.lumps[0], contrast_above=4.0)
    bounded = replace(found, untrusted=replace(found.untrusted, lumps=(lump,)))
    table = next(
        table for table in lump_map_page(bounded, title="Map", subtitle="").tables if table.title.startswith("Lumps")
    )
    assert "above 4" in table.rows[0]


def test_the_spheres_of_the_view_have_the_spread_of_the_posterior() -> None:
    found = map_of(21)
    samples = found.lumps[0].estimate.samples
    middle, *others = lump_balls(found.numbers, samples=400)
    assert not middle.is_sample
    assert middle.z_mm == pytest.approx(-np.median(samples["centre_depth_mm"]))
    assert all(ball.is_sample for ball in others)
    for name, values in {
        "x_mm": [ball.x_mm for ball in others],
        "centre_depth_mm": [-ball.z_mm for ball in others],
        "diameter_mm": [ball.diameter_mm for ball in others],
    }.items():
        assert sorted(values) == pytest.approx(sorted(samples[name]))


def test_a_guide_names_the_next_place_first_and_withholds_as_a_map() -> None:
    found = map_of(22)
    page = guide_page(found, title="Next place", subtitle="")
    assert [picture.title for picture in page.pictures] == ["Plan view"]
    assert page.tables[0].values == ((8.0, 4.0, 0.3),)
    withheld = guide_page(replace(found, trusted=False), title="Next place", subtitle="")
    assert withheld.tables == ()
    assert withheld.pictures == ()
