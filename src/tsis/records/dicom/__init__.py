"""DICOM: frames as Secondary Capture, estimates as a structured report, and the transfer of both to an archive.

::

    dicom_files(record, identified=False)       the instances, in memory
    write_dicom(record, folder)                 the same as files
    c_store(files, host=, port=, called_ae=)    to an archive by C-STORE
    stow_rs(files, url=)                        to an archive by DICOMweb
"""

from tsis.records.dicom._association import c_store, stow_rs
from tsis.records.dicom._files import DicomFile
from tsis.records.dicom._report import dicom_files, write_dicom

__all__ = ["DicomFile", "c_store", "dicom_files", "stow_rs", "write_dicom"]
