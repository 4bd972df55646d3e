"""Press a phantom with the virtual probe, and estimate its inclusion. Research use only.

A release runs this file with the built wheel, and checks its types with mypy and, where it is installed, pyright.
"""

from __future__ import annotations

import numpy as np

import tsis


def main() -> None:
    """Press, estimate, and print the interval of the diameter beside the truth."""
    probe: tsis.Probe = tsis.load_probe("tsis-domed")
    inclusion = tsis.Inclusion(diameter_mm=9.0, depth_mm=4.0, young_kpa=60.0)
    phantom = tsis.Phantom(young_kpa=5.0, poisson=0.49, thickness_mm=30.0, inclusion=inclusion)
    virtual = tsis.virtual.VirtualProbe(probe, rng=np.random.default_rng(11))
    images: list[tsis.TactileImage] = [virtual.press(phantom, force_n=force) for force in (0.5, 1.0)]
    reference = [virtual.press(phantom.without_inclusion(), force_n=force) for force in (0.5, 1.0)]
    estimate: tsis.Estimate = tsis.inclusion.estimate(
        images, reference=reference, probe=probe, calibration=virtual.calibration
    )
    low, high = estimate.interval(0.9)["diameter_mm"]
    print(f"diameter {low:.2f} to {high:.2f} mm; it is {inclusion.diameter_mm:g} mm. Research use only.")


if __name__ == "__main__":
    main()
