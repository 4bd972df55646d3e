"""Draw the pictures of the page on image formation: python -m docs.images.image_formation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from studies.section_5_1 import PROBE, bench, draw, pressed, run

from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor, expose
from tsis.model.image import TactileImage
from tsis.optics.face_light import irradiance
from tsis.present.figures import tactile_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tsis.model.calibration import LightMap

HERE = Path(__file__).parent


def light_on_face(light: LightMap, ax: Axes) -> None:
    """The untouched face, seen by the camera."""
    shown = ax.pcolormesh(light.x_mm, light.y_mm, light.relative, shading="gouraud")
    shown.set_clip_path(Circle((0.0, 0.0), PROBE.radius_mm, transform=ax.transData))
    ax.set(title="light on the untouched face", xlabel="x / mm", ylabel="y / mm", aspect="equal")
    ax.get_figure().colorbar(shown, ax=ax, label="over its mean", fraction=0.046, pad=0.02)  # type: ignore[union-attr]


def main() -> None:
    """Both pictures."""
    draw(run(), HERE / "contact-models.png")
    traced = irradiance(PROBE)
    press, sensor = pressed(10.0, 0.3), Sensor(field_angle_deg=10.0)
    figure = Figure(figsize=(11.0, 3.4), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    light_on_face(traced.near_undented(), left)
    for ax, light, title in ((middle, None, "even light"), (right, traced.on(press), "traced light")):
        frame = expose(render(press, sensor, bench(), light=light), sensor, np.random.default_rng(1))
        tactile_image(TactileImage(grey=frame, mm_per_pixel=sensor.mm_per_pixel), ax)
        ax.set_title(f"10 mm tip, 0.3 N, {title}")
    figure.supxlabel("Research use only", fontsize=8)
    figure.savefig(HERE / "light-on-the-face.png", dpi=110)


if __name__ == "__main__":
    main()
