"""DICOM files of a map of lumps: the modulus as a Parametric Map, the probability of a lump as a Segmentation of it.

The coordinates are those of the scan: DICOM's x and y are the map's, and z, upwards from the skin, is minus the depth,
as depth itself would make the axes left-handed. A frame is the plane of one depth, the nearest to the skin first; x
runs along its rows, y along its columns. The frame of reference is the map's own, and its directions are none of the
body: DICOM takes x to point to the left and y to the back where NIfTI takes them to the right and the front, so that a
viewer shows the same map in both turned by half a turn around z.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import import_extra
from tsis.records.dicom import (
    ELASTICITY,
    KILOPASCAL,
    SCHEME,
    ExportIdentity,
    Series,
    coding_schemes,
    concept,
    describe,
    deterministic_uid,
    sealed,
    set_moment,
)
from tsis.records.values import Target

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from pydicom.dataset import Dataset

    from tsis.mapping.lump_map import MapNumbers
    from tsis.records.dicom import DicomFile


UNKNOWN_TIME = datetime(1900, 1, 1, tzinfo=UTC)
MODULUS = Series(number=1, what="modulus", description="Modulus", modality="OT", started=UNKNOWN_TIME)
PROBABILITY = Series(
    number=2, what="probability", description="Probability of a lump", modality="SEG", started=UNKNOWN_TIME
)
TISSUE = ("85756007", "SCT", "Tissue")
LUMP = ("lump", SCHEME, "Lump stiffer than its surroundings")
POSTERIOR = ("posterior", SCHEME, "Posterior probability")
MOST_LEVELS = 255  # stored value of the probability 1


def map_dicom_files(numbers: MapNumbers) -> tuple[DicomFile, ...]:
    """The volumes of a map as DICOM instances of one study.

    ``modulus-kpa.dcm`` is a Parametric Map of the mean of Young's modulus in kPa, as 32-bit floats.
    ``probability.dcm`` is a fractional Segmentation (PROBABILITY) of the probability that a voxel lies in a lump, in
    steps of 1/255, whose source image is the Parametric Map. The module tells their axes.

    Equal numbers give equal bytes and UIDs with the same version. The patient is a pseudonym derived from the numbers;
    the name of the scan and every time are left out.

    Raises
    ------
    MissingExtraError
        When the libraries of the extra ``dicom`` are not installed.
    """
    _highdicom()
    content = (numbers.x_mm, numbers.y_mm, numbers.depth_mm, numbers.probability, numbers.modulus_kpa)
    identity = f"SCAN-{deterministic_uid('map', *(values.tobytes() for values in content))[-16:]}"
    target = Target(number=1, kind="subject", made=UNKNOWN_TIME, id=identity)
    cover = ExportIdentity(identified=False, target=target)
    modulus = _modulus(numbers, cover)
    return (
        sealed(modulus, "modulus-kpa.dcm"),  # whose UID the other cites
        sealed(_segmentation(numbers.probability, modulus, cover), "probability.dcm"),
    )


def _highdicom() -> Any:
    return import_extra("highdicom", feature="DICOM of a map", extra="dicom")


def _modulus(numbers: MapNumbers, cover: ExportIdentity) -> Dataset:
    """The Parametric Map, still without a UID."""
    hd = _highdicom()
    stored = numbers.modulus_kpa.astype(np.float32)
    low, high = float(stored.min()), float(stored.max())
    dataset: Dataset = hd.pm.ParametricMap(
        source_images=[_plane(numbers, cover)],
        pixel_array=stored,
        plane_positions=[
            hd.PlanePositionSequence("PATIENT", (float(numbers.x_mm[0]), float(numbers.y_mm[0]), -float(depth)))
            for depth in numbers.depth_mm
        ],
        contains_recognizable_visual_features=False,
        real_world_value_mappings=[
            hd.pm.RealWorldValueMapping(
                lut_label="kPa",
                lut_explanation="Mean of Young's modulus in kPa",
                unit=concept(KILOPASCAL),
                value_range=(low, high),
                quantity_definition=concept(ELASTICITY),
            )
        ],
        voi_lut_transformations=[
            hd.VOILUTTransformation(window_center=(low + high) / 2, window_width=max(high - low, 1e-3))
        ],
        content_label="MODULUS_KPA",
        content_description="Mean of Young's modulus in kPa, research use only",
        **_instance(MODULUS),
    )
    dataset.Laterality = ""  # required for a part that may be paired; unknown
    # The library asks for a source image and cites it; the map of a scan has none.
    del dataset.SourceImageSequence, dataset.ReferencedSeriesSequence
    for group in dataset.PerFrameFunctionalGroupsSequence:
        if "DerivationImageSequence" in group:
            del group.DerivationImageSequence
    return _described(dataset, cover, MODULUS)


def _plane(numbers: MapNumbers, cover: ExportIdentity) -> Dataset:
    """A plane of the map without pixels: study, frame of reference, size, orientation and spacing."""
    from pydicom.dataset import Dataset
    from pydicom.uid import SecondaryCaptureImageStorage

    plane = Dataset()
    describe(plane, cover, MODULUS)
    plane.SOPClassUID, plane.SOPInstanceUID = SecondaryCaptureImageStorage, deterministic_uid("plane")
    plane.FrameOfReferenceUID = deterministic_uid("frame of reference", cover.key)
    plane.PositionReferenceIndicator = ""
    plane.Rows, plane.Columns = len(numbers.y_mm), len(numbers.x_mm)
    across, down, deep = numbers.spacing_mm
    plane.PixelSpacing, plane.SliceThickness = [down, across], deep  # the distance of rows first
    plane.ImageOrientationPatient = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    plane.ImagePositionPatient = [float(numbers.x_mm[0]), float(numbers.y_mm[0]), -float(numbers.depth_mm[0])]
    return plane


def _segmentation(probability: NDArray[np.float64], modulus: Dataset, cover: ExportIdentity) -> Dataset:
    """The Segmentation of the Parametric Map, still without a UID."""
    hd = _highdicom()
    algorithm = hd.AlgorithmIdentificationSequence(name="tsis map", family=concept(POSTERIOR), version=__version__)
    segment = hd.seg.SegmentDescription(
        segment_number=1,
        segment_label="Lump",
        segmented_property_category=concept(TISSUE),
        segmented_property_type=concept(LUMP),
        algorithm_type="AUTOMATIC",
        algorithm_identification=algorithm,
    )
    dataset: Dataset = hd.seg.Segmentation(
        source_images=[modulus],
        pixel_array=probability[..., np.newaxis],
        segmentation_type="FRACTIONAL",
        fractional_type="PROBABILITY",
        max_fractional_value=MOST_LEVELS,
        segment_descriptions=[segment],
        omit_empty_frames=False,
        content_label="LUMP_PROBABILITY",
        content_description="Probability of a lump, research use only",
        coding_schemes=coding_schemes(),
        **_instance(PROBABILITY),
    )
    return _described(dataset, cover, PROBABILITY)


def _instance(series: Series) -> dict[str, Any]:
    """What the library asks of every instance; its UIDs are set afterwards."""
    return {
        "series_instance_uid": deterministic_uid("unsealed"),
        "series_number": series.number,
        "sop_instance_uid": deterministic_uid("unsealed"),
        "instance_number": 1,
        "manufacturer": "tsis",
        "manufacturer_model_name": "tsis",
        "software_versions": __version__,
        "device_serial_number": "tsis",
    }


def _described(dataset: Dataset, cover: ExportIdentity, series: Series) -> Dataset:
    """The instance with patient, study, series and notice, and with nothing of chance or of the present time."""
    describe(dataset, cover, series)
    del dataset.QualityControlSubject  # a map does not tell a phantom from a subject
    dataset.ImageComments = RESEARCH_USE_ONLY
    set_moment(dataset)
    organization = deterministic_uid("dimensions", cover.key, series.what)
    for item in (*dataset.DimensionIndexSequence, *dataset.DimensionOrganizationSequence):
        item.DimensionOrganizationUID = organization
    return dataset
