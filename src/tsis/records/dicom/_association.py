"""Transfer of instances: by C-STORE over a DICOM association, and by DICOMweb (STOW-RS)."""

from __future__ import annotations

import ipaddress
import socket
import ssl
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from tsis.errors import InputError, RecordsError, import_extra
from tsis.model import require_integer, require_number, require_type
from tsis.records.dicom._files import pydicom

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from tsis.records.dicom._files import DicomFile


# Exceptions of dicomweb-client for an invalid response: JSON of another form, truncated XML.
UNREADABLE = (ValueError, LookupError, AttributeError, TypeError, SyntaxError)


def stow_rs(
    files: Sequence[DicomFile],
    *,
    url: str,
    token: str | None = None,
    headers: Mapping[str, str] | None = None,
    timeout_s: float = 30.0,
    allow_plain_http: bool = False,
) -> tuple[str, ...]:
    """Store instances in an archive, each in a separate request, and return their UIDs in order.

    Parameters
    ----------
    files
        Result of `dicom_files`.
    url
        Root of the DICOMweb service, e.g. ``https://archive.example/dicom-web``.
    token
        Bearer token, sent to this address alone: a redirect is an error.
    headers
        Further headers.
    timeout_s
        Seconds in [0.1, 600] to wait for a connection and for each response.
    allow_plain_http
        Whether to send without encryption; ``http`` to this machine is always allowed.

    Raises
    ------
    RecordsError
        When the archive is unreachable or refuses an instance; the instances before it are stored, and repeating the
        transfer is safe.
    InputError
        When the address is invalid, or is plain ``http`` to another machine.
    """
    if not files:
        raise InputError("files must hold at least one instance; got none")
    timeout_s = require_number("timeout_s", timeout_s, 0.1, 600.0)
    here = _check_address(url, allow_plain_http=allow_plain_http)
    requests = import_extra("requests", feature="STOW-RS", extra="dicom")
    web = import_extra("dicomweb_client.api", feature="STOW-RS", extra="dicom")
    with requests.Session() as session:
        session.hooks["response"].append(_check_response)
        session.trust_env = not here  # no proxy to this machine
        session.headers.update(headers or {})
        if token is not None:
            session.auth = _bearer(token)
        client = web.DICOMwebClient(url.rstrip("/"), session=session, timeout=timeout_s)
        client.set_http_retry_params(retry=False)
        for file in files:
            _store_over_web(client, file, url, timeout_s)
    return tuple(file.sop_instance_uid for file in files)


def _check_address(url: str, *, allow_plain_http: bool) -> bool:
    """Check the address; return whether it is of this machine."""
    require_type("url", url, str)
    try:
        parts = urlsplit(url)
        host = parts.hostname or ""
        valid = parts.scheme in ("http", "https") and host and parts.port != 0
    except ValueError:
        valid, host = False, ""
    if not valid or parts.username is not None or parts.query or parts.fragment:
        raise InputError(
            "url must be the http or https address of a DICOMweb service, without name, password or query; "
            f"got {url!r:.200}"
        )
    if parts.scheme == "http" and not allow_plain_http and not _is_this_machine(host):
        raise InputError(
            f"url must start with https where it leaves this machine, since anybody on the way reads plain http; got "
            f"{url!r:.200}; allow plain http explicitly in a network that you trust"
        )
    return _is_this_machine(host)


def _is_this_machine(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _bearer(token: str) -> Any:
    """An authentication that sets the token; without one a session would use the user's .netrc file."""
    if not token.isascii() or not token.isprintable() or not token.strip():
        raise InputError("token must be printable ASCII; got something else, which is not repeated here")

    def sign(request: Any) -> Any:
        request.headers["Authorization"] = f"Bearer {token}"
        return request

    return sign


def _check_response(response: Any, **_: Any) -> None:
    if response.is_redirect:
        response.close()  # not closed otherwise, after the exception
        raise RecordsError(
            f"the archive must answer at the address given; {response.url} sends to "
            f"{response.headers.get('Location', 'nowhere')!r:.200}, which was not followed"
        )


def _store_over_web(client: Any, file: DicomFile, url: str, timeout_s: float) -> None:
    errors = import_extra("requests.exceptions", feature="STOW-RS", extra="dicom")
    try:
        response = client.store_instances([file.dataset()])
    except errors.HTTPError as error:
        raise RecordsError(_answer_refusal(error.response, file, url)) from error
    except errors.Timeout as error:
        raise RecordsError(f"{url} must answer within {timeout_s:g} s; it was silent at {file.name}") from error
    except errors.ConnectionError as error:
        raise RecordsError(
            f"{url} must be reachable; no connection is to be had, or it broke off: {_cause(error)}"
        ) from error
    except (*UNREADABLE, errors.RequestException) as error:
        raise RecordsError(
            f"{url} must answer as a DICOMweb service does; it did not at {file.name}: {error}"
        ) from error
    failed = response.get("FailedSOPSequence")
    stored = {str(item.get("ReferencedSOPInstanceUID")) for item in response.get("ReferencedSOPSequence") or []}
    if failed or file.sop_instance_uid not in stored:
        reason = failed[0].get("FailureReason") if failed else None
        why = f"failure reason 0x{reason:04X}" if reason is not None else "it does not say that it stored it"
        raise RecordsError(f"{url} must take every instance; {file.name} was not stored: {why}")


def _answer_refusal(response: Any, file: DicomFile, url: str) -> str:
    status = f"{response.status_code} {response.reason or ''}".strip()
    cure = {
        401: "; give a token that the archive knows",
        403: "; the archive does not let this token store",
        **dict.fromkeys((404, 405), "; check the address, a DICOMweb service often starts at /dicom-web or /dicomweb"),
        413: "; the archive takes no requests of this size",
        415: "; the archive does not take this kind of instance",
    }.get(response.status_code, "")
    return f"{url} must take every instance; it answered {status} at {file.name}{cure}"


def _cause(error: BaseException) -> str:
    """The innermost reason; its wrappers only add class names and addresses."""
    reason: Any = error
    while getattr(reason, "args", None) and isinstance(reason.args[0], BaseException):
        reason = reason.args[0]
    reason = getattr(reason, "reason", reason)
    message = str(reason).rpartition(": ")[2] or type(error).__name__
    return message[:200]


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
