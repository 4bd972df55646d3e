"""Draw the picture of hardness by contact: python docs/images/hardness.py."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tsis
from tsis.catalog.phantoms import load_sphere
from tsis.hardness import estimate
from tsis.hardness.table import build_contact_table
from tsis.imaging import features
from tsis.present.figures import contact_growth, tactile_image
from tsis.virtual.direct_contact import DirectContactRig

RADIUS_MM, POISSON, FORCE_N = 3.0, 0.475, 0.7
YOUNG_KPA = np.geomspace(40.0, 500.0, 60)
PROBES = {"tsis-2011": "#d55e00", "tsis-direct": "#0072b2"}  # told apart without red-green vision


def main() -> None:
    """Press, estimate, draw."""
    probe, sphere = tsis.load_probe("tsis-direct"), load_sphere("cl2000x")
    rig = DirectContactRig(probe, rng=np.random.default_rng(1))
    frames = rig.press_path(sphere, forces_n=(0.7, 1.2))
    found = estimate(frames, probe=probe, calibration=rig.calibration)

    figure = Figure(figsize=(11.5, 3.6), layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.25, 1, 1])
    tactile_image(frames[-1], left, features=features(frames[-1])).set_title("what the camera sees at 1.2 N")
    contact_growth(found, middle, table=build_contact_table(probe)).set_title("how the contact grows")
    for name, colour in PROBES.items():
        table = build_contact_table(tsis.load_probe(name))
        contact = np.exp(table.log_radius(YOUNG_KPA, POISSON, RADIUS_MM, FORCE_N))
        right.plot(YOUNG_KPA, contact, color=colour, label=name)
    rigid = np.cbrt(750.0 * FORCE_N * RADIUS_MM * (1 - POISSON**2) / YOUNG_KPA)
    right.plot(YOUNG_KPA, rigid, "--", color="0.4", label="Hertz, rigid probe")
    right.set(xscale="log", xlabel="modulus of the sphere / kPa", ylabel="contact radius a / mm")
    right.set_xticks([50, 100, 200, 500], ["50", "100", "200", "500"])
    right.minorticks_off()
    right.set_title(f"at {FORCE_N:g} N, sphere of {RADIUS_MM:g} mm")
    right.legend(frameon=False)
    figure.savefig(Path(__file__).with_name("hardness-by-contact.png"), dpi=110)


if __name__ == "__main__":
    main()
