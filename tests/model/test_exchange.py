"""Posteriors in ArviZ and images in xarray hold the same numbers, with their units and coordinates."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray
from tests.model.test_content import disc, estimate

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import ImageMismatchError, InputError, MissingExtraError
from tsis.imaging import features
from tsis.model.image import TactileImage, image_from_xarray, image_stack

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

with warnings.catch_warnings():
    warnings.simplefilter("ignore", FutureWarning)
    import arviz


def test_arviz_summarises_the_same_posterior() -> None:
    result = estimate()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        summary: Any = arviz.summary(result.to_arviz(), kind="stats", hdi_prob=0.9, round_to="none")
    for name, values in result.samples.items():
        assert summary.loc[name, "mean"] == pytest.approx(values.mean(), rel=1e-12)
        assert summary.loc[name, "sd"] == pytest.approx(values.std(ddof=1), rel=1e-12)


def test_a_posterior_comes_back_from_a_file(tmp_path: Path) -> None:
    result = estimate()
    saved = result.to_arviz().to_netcdf(str(tmp_path / "posterior.nc"))
    read: Any = arviz.from_netcdf
    again = read(saved).posterior
    assert again.sizes == {"chain": 1, "draw": 500}
    for name, values in result.samples.items():
        np.testing.assert_array_equal(again[name].values, values[None])
        assert again[name].attrs["units"] == "mm"
        assert again[name].attrs["prior_sd"] == result.prior_sd[name]
    assert (again["diameter_mm"].attrs["identified"], again["depth_mm"].attrs["identified"]) == (1, 0)
    assert again.attrs["notice"] == RESEARCH_USE_ONLY
    assert again.attrs["presence"] == 0.9
    assert again.attrs["flags"] == "depth_mm_not_identified"


def test_release_1_of_arviz_gets_its_own_call(monkeypatch: pytest.MonkeyPatch) -> None:
    class Current:
        """The interface of ArviZ from release 1 on, whose trees are those of xarray."""

        @staticmethod
        def from_dict(data: dict[str, dict[str, Any]]) -> xarray.DataTree:
            groups = {
                group: xarray.Dataset({name: (("chain", "draw"), values) for name, values in variables.items()})
                for group, variables in data.items()
            }
            return xarray.DataTree.from_dict(groups)

    monkeypatch.setitem(sys.modules, "arviz", Current)
    result = estimate()
    tree = result.to_arviz()
    assert isinstance(tree, xarray.DataTree)
    for name, values in result.samples.items():
        np.testing.assert_array_equal(tree["posterior"][name].values, values[None])
        assert tree["posterior"][name].attrs["units"] == "mm"
    assert tree["posterior"].attrs["inference_library"] == "tsis"


def test_an_image_has_coordinates_in_mm_from_the_axis() -> None:
    image = replace(disc(), axis_px=(40.0, 30.0))
    array = image.to_xarray()
    assert array.dims == ("y", "x")
    assert float(array.sel(x=0.5, y=-1.0, method="nearest")) == image.grey[25, 45]
    centroid = features(image).centroid_mm
    assert centroid is not None
    weights = array / array.sum()
    assert [float((weights * array[name]).sum()) for name in ("x", "y")] == pytest.approx(list(centroid), rel=1e-9)
    assert array["x"].attrs["units"] == array["y"].attrs["units"] == "mm"
    assert float(array["y"][1] - array["y"][0]) == pytest.approx(0.2)


def test_without_a_scale_coordinates_are_in_pixels() -> None:
    array = replace(disc(), mm_per_pixel=None).to_xarray()
    assert array["x"].attrs["units"] == "px"
    np.testing.assert_allclose(array["x"], np.arange(80) - 39.5)


@pytest.mark.parametrize("changes", [{}, {"mm_per_pixel": None}, {"force_n": None}, {"axis_px": (3.0, 4.5)}])
def test_an_image_comes_back(changes: dict[str, Any], tmp_path: Path) -> None:
    image = replace(disc(), **changes)
    assert image_from_xarray(image.to_xarray()) == image
    image.to_xarray().to_netcdf(tmp_path / "image.nc", engine="h5netcdf")
    with xarray.open_dataarray(tmp_path / "image.nc", engine="h5netcdf") as array:
        assert image_from_xarray(array) == image


def test_the_scale_follows_from_coordinates_alone() -> None:
    image = replace(disc(), axis_px=(3.0, 4.5))
    array = image.to_xarray().drop_attrs(deep=False)
    again = image_from_xarray(array)
    assert again.scale() == pytest.approx(image.scale())
    assert again.axis() == pytest.approx(image.axis())
    np.testing.assert_array_equal(again.grey, image.grey)


def test_a_part_of_an_array_keeps_its_place() -> None:
    for array in (disc().to_xarray(), disc().to_xarray().drop_attrs(deep=False)):
        part = image_from_xarray(array.isel(x=slice(10, 50), y=slice(5, 50)))
        assert features(part).centroid_mm == pytest.approx(features(disc()).centroid_mm)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda array: array.T, r"must have the dimensions \('y', 'x'\)"),
        (lambda array: array.values, "must have the dimensions"),
        (lambda array: array.drop_attrs(deep=False).isel(x=[0, 1, 5]), "must ascend by equal steps"),
        (lambda array: array.drop_attrs(deep=False).isel(x=slice(None, None, -1)), "must ascend by equal steps"),
        (lambda array: array.drop_attrs(deep=False).isel(x=[0]), "must ascend by equal steps"),
    ],
)
def test_arrays_that_are_no_image_are_refused(change: Callable[[Any], Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        image_from_xarray(change(disc().to_xarray()))


def test_a_stack_holds_every_press() -> None:
    images = [
        replace(disc(), grey=disc().grey * level, force_n=force, name=f"press {level}")
        for level, force in ((1.0, 0.5), (0.5, None), (0.25, 1.0))
    ]
    stack = image_stack(images)
    assert stack.dims == ("press", "y", "x")
    np.testing.assert_array_equal(stack.values, np.stack([image.grey for image in images]))
    np.testing.assert_array_equal(stack["force_n"], [0.5, np.nan, 1.0])
    assert stack["frame"].values.tolist() == ["press 1.0", "press 0.5", "press 0.25"]
    np.testing.assert_array_equal(stack["x"], images[0].to_xarray()["x"])
    assert stack["x"].attrs["units"] == "mm"
    loaded = stack.where(stack["force_n"] > 0.4, drop=True)
    assert loaded.sizes["press"] == 2
    assert image_from_xarray(stack.isel(press=2)).grey.tolist() == images[2].grey.tolist()


@pytest.mark.parametrize(
    "change", [{"mm_per_pixel": (0.1, 0.1)}, {"axis_px": (1.0, 1.0)}, {"full_scale": 4095.0}, {"grey": np.ones((2, 2))}]
)
def test_images_of_different_cameras_are_not_stacked(change: dict[str, Any]) -> None:
    with pytest.raises(ImageMismatchError, match="images of a stack must share"):
        image_stack([disc(), replace(disc(), **change)])
    with pytest.raises(InputError, match="at least one TactileImage"):
        image_stack([])


@pytest.mark.parametrize(
    ("module", "product", "call"),
    [
        ("arviz", "ArviZ", lambda: estimate().to_arviz()),
        ("xarray", "xarray", lambda: disc().to_xarray()),
        ("xarray", "xarray", lambda: image_stack([disc()])),
    ],
)
def test_without_the_extra_one_sentence_names_it(
    module: str, product: str, call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError) as error:
        call()
    assert f"needs {product}, which is not installed" in str(error.value)
    assert str(error.value).endswith('install it with: python -m pip install "tsis[analysis]"')
    assert "\n" not in str(error.value)


def test_an_image_is_made_of_a_plain_array() -> None:
    array = xarray.DataArray(np.eye(3), dims=("y", "x"))
    assert image_from_xarray(array) == TactileImage(grey=np.eye(3))
