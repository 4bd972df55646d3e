"""From a press on a phantom to a report, one room of the package after the other. Research use only.

Each part stands for what a laboratory does; a virtual probe takes the place of probe, lamps and camera. It ends in a
number that must hold: the interval of the diameter contains the true one.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import tsis
from tsis.calibration.file import ProbeCalibration, write_calibration
from tsis.imaging import features
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor, expose
from tsis.inclusion import InclusionPrior
from tsis.inclusion.frames import ring_edges
from tsis.optics.face_light import irradiance
from tsis.present.html import html_bytes
from tsis.present.inclusion import inclusion_page

FORCES_N = (0.5, 1.0)


def main(folder: Path) -> None:
    """Press, light, record, calibrate, estimate, and write the report into a new folder."""
    # A probe and a phantom. Lengths in millimetres, moduli in kilopascals.
    probe = tsis.load_probe("tsis-domed")
    inclusion = tsis.Inclusion(diameter_mm=9.0, depth_mm=4.0, young_kpa=60.0)
    phantom = tsis.Phantom(young_kpa=5.0, poisson=0.49, thickness_mm=30.0, inclusion=inclusion)

    # The press: what the inclusion adds to the pressure in the middle of the face.
    field = tsis.mechanics.press(probe, phantom, force_n=1.0)
    plain = tsis.mechanics.press(probe, phantom.without_inclusion(), force_n=1.0)
    print(f"pressure in the middle {field.pressure_kpa[0]:.2f} kPa; without inclusion {plain.pressure_kpa[0]:.2f} kPa")

    # The light of the lamps on the pressed face, and the picture that an ideal camera takes of it.
    rng = np.random.default_rng(11)
    virtual = tsis.virtual.VirtualProbe(probe, rng=rng)
    response, sensor = virtual.calibration, Sensor()
    light = irradiance(probe).on(field, saturation_kpa=response.saturation_kpa)
    grey = expose(render(field, sensor, response, light=light), sensor, rng)
    ideal = tsis.TactileImage(grey=grey, mm_per_pixel=sensor.mm_per_pixel)
    print(f"brightest grey level {features(ideal).peak:.0f} of 255")

    # The images: presses at finite strain on the target and beside it, with all errors of an experiment.
    images = [virtual.press(phantom, force_n=force_n) for force_n in FORCES_N]
    reference = [virtual.press(phantom.without_inclusion(), force_n=force_n) for force_n in FORCES_N]

    # The calibration: grey level to pressure, in a file whose hash every result cites.
    folder.mkdir()
    file = folder / "calibration.json"
    write_calibration(ProbeCalibration(name="virtual probe", probe=probe.name, response=response), file)
    calibration = tsis.load_calibration(file).response

    # The estimate: a posterior, with flags that withhold it where it would mislead.
    estimate = tsis.inclusion.estimate(images, reference=reference, probe=probe, calibration=calibration)
    low, high = estimate.interval(0.9)["diameter_mm"]

    # The report, one page without scripts.
    page = inclusion_page(
        estimate,
        title="Press on a phantom",
        subtitle=f"{probe.name}, {FORCES_N[0]:g} and {FORCES_N[1]:g} N",
        targets=images,
        references=reference,
        prior=InclusionPrior(),
        ring_edges_mm=ring_edges(probe),
        truth={"diameter_mm": inclusion.diameter_mm, "depth_mm": inclusion.depth_mm, "young_kpa": inclusion.young_kpa},
    )
    (folder / "report.html").write_bytes(html_bytes(page))
    print(f"diameter {low:.2f} to {high:.2f} mm; it is {inclusion.diameter_mm:g} mm. Research use only.")
    assert low < inclusion.diameter_mm < high < low + 2.0


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "press-to-report"))
