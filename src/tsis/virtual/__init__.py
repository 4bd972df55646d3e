"""The virtual probe: mechanics, light and camera without hardware."""

from tsis.virtual._calibration_bench import VirtualBench, bench_name, bench_seed
from tsis.virtual._camera import (
    FORCE_SETTING,
    GEL_BALL_MM,
    GEL_PRESS_SETTING,
    GEL_PRESSES,
    LARGEST_FORCE_N,
    USUAL_MS,
    VirtualCamera,
    VirtualGelCamera,
    camera_settings,
    virtual_gel_sensor,
    virtual_mode,
)
from tsis.virtual._direct_contact import DIRECT_CONTACT_RESOLUTION, DirectContactRig, direct_contact_calibration
from tsis.virtual._exposure import load_exposure
from tsis.virtual._gel_frames import (
    GelBallPress,
    GelLight,
    RenderedPress,
    ball_press,
    gel_depth_mm,
    marker_ink,
    random_gel_light,
    random_gel_press,
    render_gel,
    rendered_series,
)
from tsis.virtual._gel_sensor import VirtualGelSensor
from tsis.virtual._gige import GigEServer
from tsis.virtual._loading_camera import MachineErrors
from tsis.virtual._loading_machine import FLAT_LEVELS, PROBE_PAD_SD, VirtualLoadingMachine, tissue_calibration
from tsis.virtual._probe import FINE_RESOLUTION, VirtualProbe, exposure_for, nominal_calibration
from tsis.virtual._repeated import (
    DEEPEST_FRACTION,
    LARGEST_DRAWN_POISSON,
    RepeatedExamination,
    coverage_counts,
    draw_phantom,
    reference_site,
    stored_coverage,
    surround,
)
from tsis.virtual._scale_targets import ball_frame, dot_board_frame, untouched_frame

__all__ = [
    "DEEPEST_FRACTION",
    "DIRECT_CONTACT_RESOLUTION",
    "FINE_RESOLUTION",
    "FLAT_LEVELS",
    "FORCE_SETTING",
    "GEL_BALL_MM",
    "GEL_PRESSES",
    "GEL_PRESS_SETTING",
    "LARGEST_DRAWN_POISSON",
    "LARGEST_FORCE_N",
    "PROBE_PAD_SD",
    "USUAL_MS",
    "DirectContactRig",
    "GelBallPress",
    "GelLight",
    "GigEServer",
    "MachineErrors",
    "RenderedPress",
    "RepeatedExamination",
    "VirtualBench",
    "VirtualCamera",
    "VirtualGelCamera",
    "VirtualGelSensor",
    "VirtualLoadingMachine",
    "VirtualProbe",
    "ball_frame",
    "ball_press",
    "bench_name",
    "bench_seed",
    "camera_settings",
    "coverage_counts",
    "direct_contact_calibration",
    "dot_board_frame",
    "draw_phantom",
    "exposure_for",
    "gel_depth_mm",
    "load_exposure",
    "marker_ink",
    "nominal_calibration",
    "random_gel_light",
    "random_gel_press",
    "reference_site",
    "render_gel",
    "rendered_series",
    "stored_coverage",
    "surround",
    "tissue_calibration",
    "untouched_frame",
    "virtual_gel_sensor",
    "virtual_mode",
]
