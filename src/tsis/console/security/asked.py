"""What a request says of itself: the name it was sent to, the page it comes from, its credentials."""

from __future__ import annotations

import ipaddress
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from starlette.types import Scope

Headers = list[tuple[bytes, bytes]]

SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
ONCE = (b"host", b"origin", b"authorization")  # more than one of these is somebody's trick
_HOST = re.compile(r"(\[[0-9A-Fa-f:.]{2,45}\]|[A-Za-z0-9](?:[A-Za-z0-9._-]{0,252}))(?::([0-9]{1,5}))?")
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")
_SCHEMES = {"ws": "http", "wss": "https"}
# What servers in between write to tell whom they stand for. Nobody stands between here, so whoever sends them lies.
_FORWARDED = (b"forwarded", b"x-forwarded-", b"x-real-ip", b"x-original-", b"x-rewrite-", b"x-script-name")


def headers_of(scope: Scope) -> dict[str, str]:
    """The headers by their names in lower case."""
    found: dict[str, str] = {}
    for raw_name, raw_value in scope["headers"]:
        name, value = raw_name.decode("latin-1").lower(), raw_value.decode("latin-1")
        between = "; " if name == "cookie" else ", "
        found[name] = f"{found[name]}{between}{value}" if name in found else value
    return found


def is_repeated(scope: Scope) -> bool:
    """Whether a header that counts here is there more than once."""
    names = [name.lower() for name, _ in scope["headers"]]
    return any(names.count(each) > 1 for each in ONCE)


def is_plain_path(path: str) -> bool:
    """Whether a path begins at the root and holds no control character: routes end in wrong places at line ends."""
    return path.startswith("/") and _CONTROL.search(path) is None


def without_forwarded(headers: Headers) -> Headers:
    """The headers without those that only a server in between could rightly write."""
    return [(name, value) for name, value in headers if not name.lower().startswith(_FORWARDED)]


def name_of(host: str) -> str:
    """The name in a ``Host``, in lower case and without its port; empty when it is none.

    Examples
    --------
    >>> name_of("LocalHost:8642"), name_of("[::1]:8642"), name_of("localhost:8642@evil.example")
    ('localhost', '[::1]', '')
    """
    found = _HOST.fullmatch(host)
    return found[1].lower() if found else ""


def is_known(host: str, *, names: Collection[str], local: str) -> bool:
    """Whether the console is called by that ``Host``: by one of its names, or by the address that was reached.

    A name that is not known is a page elsewhere that has its own name point here; an address cannot be pointed.
    """
    name = name_of(host)
    if not name:
        return False
    return name in names or _same_address(name, local)


def is_own_origin(scope: Mapping[str, Any], headers: Mapping[str, str]) -> bool:
    """Whether what may change something, or opens a WebSocket, comes from a page of this console or from no page."""
    origin = headers.get("origin")
    if origin is None or (scope["type"] == "http" and scope["method"] in SAFE_METHODS):
        return True
    scheme = _SCHEMES.get(scope["scheme"], scope["scheme"])
    return origin.lower() == f"{scheme}://{headers.get('host', '')}".lower()


def _same_address(name: str, local: str) -> bool:
    try:
        return _address(name.strip("[]")) == _address(local)
    except ValueError:
        return False


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    found = ipaddress.ip_address(text.partition("%")[0])
    mapped = found.ipv4_mapped if isinstance(found, ipaddress.IPv6Address) else None
    return mapped or found
