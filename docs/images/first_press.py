"""Draw the picture of the README: python docs/images/first_press.py."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tsis
from tsis.imaging import features
from tsis.imaging.corrections import subtract_background
from tsis.inclusion import estimate, load_prior
from tsis.present.figures import marginal, tactile_image
from tsis.virtual.probe import VirtualProbe


def main() -> None:
    """Press, estimate, draw."""
    probe, phantom, prior = (
        tsis.load_probe("tsis-domed"),
        tsis.load_phantom("hardness-40"),
        load_prior("breast-ex-vivo"),
    )
    virtual = VirtualProbe(probe, rng=np.random.default_rng(0))
    virtual.no_contact()  # as `tsis demo` does first, so that these are its frames
    references = [virtual.press(phantom.without_inclusion(), force_n=force) for force in (0.5, 1.0)]
    targets = [virtual.press(phantom, force_n=force) for force in (0.5, 1.0)]
    result = estimate(targets, probe=probe, calibration=virtual.calibration, reference=references, prior=prior)
    target, reference = targets[-1], references[-1]

    figure = Figure(figsize=(10, 5.6), layout="constrained")
    (images,), (posteriors,) = figure.subfigures(2, 1, height_ratios=[1.5, 1], squeeze=False)
    left, right = images.subplots(1, 2)
    tactile_image(target, left).set_title("what the camera sees at 1 N")
    signal = subtract_background(target, reference)
    tactile_image(signal, right, features=features(signal), low=0.0).set_title("what the inclusion adds")
    for name, ax in zip(result.samples, posteriors.subplots(1, 3), strict=True):
        marginal(result, name, ax, prior_range=getattr(prior, name), truth=getattr(phantom.inclusion, name))
        if name == "diameter_mm":
            ax.legend(frameon=False, fontsize=8)
    figure.savefig(Path(__file__).with_name("first-press.png"), dpi=110)


if __name__ == "__main__":
    main()
