"""DICOM: frames as Secondary Capture, estimates as a structured report, and both sent to an archive.

::

    dicom_files(dossier, identified=False)      the instances, in memory
    write_dicom(dossier, folder)                the same as files
    c_store(files, host=, port=, called_ae=)    to an archive by DICOM's own protocol
    stow_rs(files, url=)                        to an archive by DICOMweb
"""

from tsis.records.dicom.export import dicom_files, write_dicom
from tsis.records.dicom.files import DicomFile

__all__ = ["DicomFile", "dicom_files", "write_dicom"]
