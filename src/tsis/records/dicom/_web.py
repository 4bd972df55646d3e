"""Transfer of instances by DICOMweb (STOW-RS)."""

from __future__ import annotations

import ipaddress
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from tsis.errors import InputError, RecordsError, import_extra
from tsis.model import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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
            _store(client, file, url, timeout_s)
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


def _store(client: Any, file: DicomFile, url: str, timeout_s: float) -> None:
    errors = import_extra("requests.exceptions", feature="STOW-RS", extra="dicom")
    try:
        response = client.store_instances([file.dataset()])
    except errors.HTTPError as error:
        raise RecordsError(_refusal(error.response, file, url)) from error
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


def _refusal(response: Any, file: DicomFile, url: str) -> str:
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
