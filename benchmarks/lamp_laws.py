"""Lamp laws, and the calibration that `tsis calibrate` makes of a probe with such lamps.

No estimate contains these laws. The session is that of the virtual calibration rig, made once a law and kept in the
cache: the tips dent the face, and the dents change the light as those of tissue do. The tips need a short exposure and
tissue a long one, `EXPOSURE` times as long, which a linear camera scales exactly.
"""

from __future__ import annotations

import hashlib
import tempfile
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import tsis
from tsis.calibration.file import calibration_bytes, calibration_sha256, read_calibration
from tsis.calibration.frames import UsableCalibration
from tsis.calibration.scale import PixelScale
from tsis.calibration.session import SessionFolder, SessionSetup, calibrate
from tsis.files.atomic import write_durably
from tsis.files.cache import cache_folder, content_key
from tsis.model.calibration import Calibration, LightMap
from tsis.optics.face_light import Irradiance, irradiance
from tsis.virtual.calibration_bench import VirtualBench
from tsis.virtual.loading_machine import MachineErrors, VirtualLoadingMachine

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe

SATURATION_KPA = 100.0
BRIGHTEST_GREY, INNER_KPA, RIM_KPA, RIM = 230.0, 4.5, 18.0, 0.93  # exposure of tissue: these pressures fill the scale
PADS_KPA = (5.0, 10.0)
TIPS_MM = (6.0, 10.0, 14.0)  # a sharper one would sink through half of a soft probe
GROWTH_PER_MM, ABSORPTION_PER_MM = 0.25, 0.05
LAMP_LAWS = ("traced", "growing", "one-side", "absorbing")


def lamp_law(name: str, probe: Probe) -> Irradiance | LightMap:
    """Light on the probe's face by one of `LAMP_LAWS`."""
    if name == "traced":
        return irradiance(probe)
    if name == "one-side":
        return irradiance(replace(probe, leds=probe.leds[:1]))
    if name == "absorbing":
        return irradiance(probe, absorption_per_mm=ABSORPTION_PER_MM)
    even = LightMap.uniform()
    return replace(even, growth_per_mm=np.full_like(even.relative, GROWTH_PER_MM))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibratedProbe:
    """A probe with its lamps, and what the laboratory knows of it.

    Attributes
    ----------
    light
        The true light.
    truth
        The true response at the exposure of tissue, with the sizes of the errors of new frames.
    known
        The calibration of the product.
    exposure
        Exposure of tissue over that of the calibration.
    """

    light: Irradiance | LightMap
    truth: Calibration
    known: UsableCalibration
    exposure: float

    def corrected(
        self, frames: Sequence[TactileImage], *, with_dents: bool = True
    ) -> tuple[tuple[TactileImage, ...], Calibration]:
        """Frames corrected by the product, and its response at their exposure, with the light on dents or without."""
        scale = self.known.calibration.need(PixelScale, "a frame").mm_per_pixel
        ready, response = self.known.pressed(
            [replace(frame, mm_per_pixel=scale) for frame in frames], on_tissue=with_dents
        )
        return tuple(ready), replace(response, gain_grey_per_kpa=self.exposure * response.gain_grey_per_kpa)


@lru_cache(maxsize=8)
def calibrated_probe(law: str, probe: Probe, seed: int) -> CalibratedProbe:
    """The probe under a lamp law with its calibration, from the cache or made; each seed has its own errors."""
    light = lamp_law(law, probe)
    machine = VirtualLoadingMachine(
        probe,
        rng=np.random.default_rng(seed),
        errors=MachineErrors(shading_sd=0.0, stray_grey=0.0),  # the frames of tissue have neither
        saturation_kpa=SATURATION_KPA,
        light=light,
        patch=False,
    )
    truth = machine.truth.response
    x, y = machine.sensor.axes_mm()
    radius = np.hypot(x, y[:, None]) / probe.radius_mm
    most_kpa = np.where(radius < RIM, INNER_KPA, np.where(radius <= 1, RIM_KPA, 0.0))
    exposure = BRIGHTEST_GREY / (float((most_kpa * light.at(x, y)).max()) * truth.gain_grey_per_kpa)
    sensor = machine.sensor
    at_tissue = Calibration(
        name=f"virtual probe, lamps {law}",
        probe=probe.name,
        gain_grey_per_kpa=exposure * truth.gain_grey_per_kpa,
        saturation_kpa=truth.saturation_kpa,
        background_grey=sensor.background_grey,
        read_noise_grey=sensor.read_noise_grey,
        shot_noise_grey=sensor.shot_noise_grey,
        shading_sd=0.05,  # the calibration is of this very probe; only its lamps age a little
        offset_sd=0.0,  # `benchmarks.worlds` adds the stray light
        light=light if isinstance(light, LightMap) else light.near_undented(),
    )
    return CalibratedProbe(light=light, truth=at_tissue, known=_session(law, probe, machine, seed), exposure=exposure)


def _session(law: str, probe: Probe, machine: VirtualLoadingMachine, seed: int) -> UsableCalibration:
    """The calibration of a session with this machine, kept in the cache."""
    decided_by = {
        "law": law,
        "probe": asdict(probe),
        "seed": seed,
        "saturation": SATURATION_KPA,
        "tips": TIPS_MM,
        "pads": PADS_KPA,
        "code": _code(),
    }
    file = cache_folder() / "lamp-laws" / f"{law}-{content_key(decided_by)}.json"
    if not file.exists():
        bench = VirtualBench(probe, rng=np.random.default_rng([seed, 1]), machine=machine)
        with tempfile.TemporaryDirectory() as folder:
            session = SessionFolder(folder + "/session")
            setup = SessionSetup(
                name=f"lamps {law}", probe=probe.name, camera="virtual", tips_mm=TIPS_MM, pads_kpa=PADS_KPA
            )
            session.begin(setup)
            for step in session.plan():
                session.save(step, bench.shots(step))
            made, _ = calibrate(session)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_durably(file, calibration_bytes(made))
    stored = read_calibration(file)
    return UsableCalibration(calibration=stored, identity=calibration_sha256(stored))


def _code() -> str:
    """Hash of the code that makes the session and its calibration."""
    root = Path(tsis.__file__).parent
    files = sorted(path for name in ("calibration", "virtual") for path in (root / name).rglob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
