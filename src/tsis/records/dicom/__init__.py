"""DICOM: frames as Secondary Capture, estimates as a structured report, and both sent to an archive.

::

    dicom_files(dossier, identified=False)      the instances, in memory
    write_dicom(dossier, folder)                the same as files
    c_store(files, host=, port=, called_ae=)    to an archive by DICOM's own protocol
    stow_rs(files, url=)                        to an archive by DICOMweb
"""

from tsis.records.dicom._association import c_store
from tsis.records.dicom._export import dicom_files, write_dicom
from tsis.records.dicom._files import DicomFile
from tsis.records.dicom._web import stow_rs

__all__ = ["DicomFile", "c_store", "dicom_files", "stow_rs", "write_dicom"]
