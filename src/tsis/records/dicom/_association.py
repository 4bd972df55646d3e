"""Transfer of instances by C-STORE over a DICOM association."""

from __future__ import annotations

import socket
import ssl
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError, RecordsError, import_extra
from tsis.model import require_integer, require_number, require_type
from tsis.records.dicom._files import pydicom

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from tsis.records.dicom._files import DicomFile


SILENT = "it broke off, was silent or wants TLS"
WARNINGS = range(0xB000, 0xC000)  # stored with a warning


def c_store(
    files: Sequence[DicomFile],
    *,
    host: str,
    port: int,
    called_ae: str,
    calling_ae: str = "TSIS",
    timeout_s: float = 30.0,
    tls: ssl.SSLContext | None = None,
) -> tuple[str, ...]:
    """Store instances in an archive and return their UIDs in order.

    Parameters
    ----------
    files
        Result of `dicom_files`.
    host, port
        Address of the archive.
    called_ae, calling_ae
        Application entity titles of the archive and of this program, at most 16 characters of ASCII.
    timeout_s
        Seconds in [0.1, 600] to wait for a connection and for each response.
    tls
        Context for an encrypted association; without it the data are not encrypted.

    Raises
    ------
    RecordsError
        When the archive is unreachable, refuses the association or an instance; the message gives each reason. The
        other instances are stored; repeating the transfer is safe.
    InputError
        When a title, the port or the timeout is invalid.
    """
    port = require_integer("port", port, 1, 65_535)
    timeout_s = require_number("timeout_s", timeout_s, 0.1, 600.0)
    entity = _entity(files, calling_ae, timeout_s)
    where = f"{called_ae} at {host}:{port}"
    with _associated(entity, host, port, _title("called_ae", called_ae), timeout_s, tls) as association:
        if not association.is_established:
            raise RecordsError(_refusal(association, where, timeout_s))
        failed = [(file, why) for file in files if (why := _store(association, file))]
    if failed:
        reported = "; ".join(f"{file.name}: {why}" for file, why in failed)
        raise RecordsError(f"{where} must take every instance; {len(failed)} of {len(files)} failed: {reported}")
    return tuple(file.sop_instance_uid for file in files)


def _entity(files: Sequence[DicomFile], calling_ae: str, timeout_s: float) -> Any:
    if not files:
        raise InputError("files must hold at least one instance; got none")
    entity = import_extra("pynetdicom", feature="C-STORE", extra="dicom").AE(ae_title=_title("calling_ae", calling_ae))
    entity.connection_timeout = entity.acse_timeout = entity.dimse_timeout = entity.network_timeout = timeout_s
    for sop_class in sorted({file.sop_class_uid for file in files}):
        entity.add_requested_context(sop_class, pydicom("uid").ExplicitVRLittleEndian)
    return entity


def _title(name: str, value: str) -> str:
    require_type(name, value, str)
    if not 0 < len(value.strip()) <= 16 or not value.isascii() or not value.isprintable() or "\\" in value:
        raise InputError(f"{name} must have 1 to 16 printable characters of ASCII without backslash; got {value!r}")
    return value.strip()


@contextmanager
def _associated(
    entity: Any, host: str, port: int, called_ae: str, timeout_s: float, tls: ssl.SSLContext | None
) -> Iterator[Any]:
    """An association, established or refused, whose connections are closed at the end."""
    event = import_extra("pynetdicom", feature="C-STORE", extra="dicom").evt.EVT_CONN_OPEN
    opened: list[Any] = []
    association = entity.associate(
        _reachable(host, port, f"{called_ae} at {host}:{port}", timeout_s, tls),
        port,
        ae_title=called_ae,
        tls_args=(tls, host) if tls else None,
        evt_handlers=[(event, lambda happened: opened.append(happened.assoc.dul.socket.socket))],
    )
    try:
        yield association
    finally:
        if association.is_established:
            association.release()
        for connection in opened:  # pynetdicom does not close one that the archive has closed
            connection.close()


def _reachable(host: str, port: int, where: str, timeout_s: float, tls: ssl.SSLContext | None) -> str:
    """The numeric address of the archive, after a trial connection, which gives a precise reason for a failure."""
    try:
        with socket.create_connection((host, port), timeout_s) as result:
            address = str(result.getpeername()[0])
            if tls is not None:
                with tls.wrap_socket(result, server_hostname=host):
                    pass
            return address
    except (socket.gaierror, UnicodeError) as error:
        raise RecordsError(f"host must be a name or address that is known; got {host!r}") from error
    except TimeoutError as error:
        raise RecordsError(f"{where} must accept a connection within {timeout_s:g} s; nothing answered") from error
    except ssl.SSLError as error:
        why = getattr(error, "verify_message", "") or error.reason or str(error)
        raise RecordsError(f"{where} must have a certificate that can be trusted, and speak TLS: {why}") from error
    except OSError as error:
        why = error.strerror or str(error)
        raise RecordsError(
            f"{where} must accept a connection: {why}; is the archive running, and is it there?"
        ) from error


def _refusal(association: Any, where: str, timeout_s: float) -> str:
    if association.is_rejected:
        response = association.acceptor.primitive
        return (
            f"{where} refused the association: {response.reason_str.lower()}; check both names of applications, "
            "and that the archive knows this one"
        )
    rejected = association.rejected_contexts
    if association.acceptor.primitive is not None and not association.accepted_contexts and rejected:
        kinds = ", ".join(str(context.abstract_syntax.name) for context in rejected)
        return f"{where} takes none of the kinds of instances: {kinds}"
    return f"{where} must answer the request for an association within {timeout_s:g} s; {SILENT}"


def _store(association: Any, file: DicomFile) -> str:
    """Why the archive refused an instance; empty on success."""
    if not association.is_established:
        return "not sent, because the archive broke off"
    if file.sop_class_uid not in {str(context.abstract_syntax) for context in association.accepted_contexts}:
        return f"the archive does not take {pydicom('uid').UID(file.sop_class_uid).name}"
    status = association.send_c_store(file.dataset()).get("Status")
    if status is None:
        return "the archive gave no answer in time, or broke off"
    if status == 0 or status in WARNINGS:
        return ""
    meanings = import_extra("pynetdicom.status", feature="C-STORE", extra="dicom").STORAGE_SERVICE_CLASS_STATUS
    meaning = " ".join(meanings.get(status, ("unknown", ""))).strip()
    return f"the archive answered 0x{status:04X} ({meaning})"
