"""Values reach other processes of joblib and Dask, and come back equal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import joblib
import numpy as np
import pytest
from distributed import Client, LocalCluster
from tests.model.test_content import disc, estimate

import tsis
from tsis.imaging import features
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe

pytestmark = pytest.mark.system


def centroid_x_mm(image: TactileImage) -> tuple[TactileImage, float]:
    centroid = features(image).centroid_mm
    assert centroid is not None
    return image, centroid[0]


def upper_end_mm(result: Estimate) -> tuple[Estimate, float]:
    return result, result.interval(0.9)["diameter_mm"][1]


def pressed(probe: Probe, seed: int) -> TactileImage:
    virtual = VirtualProbe(
        probe, rng=np.random.default_rng(seed), light=tsis.model.calibration.LightMap.uniform(), strain="small"
    )
    return virtual.press(tsis.load_phantom("hardness-100"), force_n=0.5)


def test_joblib() -> None:
    image, result = disc(), estimate()
    run = joblib.Parallel(n_jobs=2, backend="loky")
    assert run(joblib.delayed(centroid_x_mm)(item) for item in (image, image)) == [centroid_x_mm(image)] * 2
    assert run([joblib.delayed(upper_end_mm)(result)]) == [upper_end_mm(result)]
    probe = tsis.load_probe("tsis-2011")
    assert run(joblib.delayed(pressed)(probe, seed) for seed in (1, 2)) == [pressed(probe, 1), pressed(probe, 2)]


def test_dask() -> None:
    cluster_of: Any = LocalCluster
    client_of: Any = Client
    image, result, probe = disc(), estimate(), tsis.load_probe("tsis-2011")
    with (
        cluster_of(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        client_of(cluster) as client,
    ):
        assert client.submit(centroid_x_mm, image).result() == centroid_x_mm(image)
        assert client.submit(upper_end_mm, result).result() == upper_end_mm(result)
        assert client.submit(pressed, probe, 1).result() == pressed(probe, 1)
        (scattered,) = client.scatter([result])
        assert client.submit(upper_end_mm, scattered).result()[0] == result
