"""How often somebody may try to log in: a few times a minute, then after waits that grow."""

from __future__ import annotations

import ipaddress
import time
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


WINDOW_S = 60.0
A_MINUTE = 5  # tries from one address before it waits
A_MINUTE_OVER_ALL = 30
LONGEST_WAIT_S = 3600.0
FORGOTTEN_S = 2 * LONGEST_WAIT_S  # after which an address begins anew
ADDRESSES = 10_000  # remembered at most
NETWORK_OF_ONE = 64  # bits of an IPv6 address that one customer has whole


@dataclass(slots=True)
class _Tries:
    seen_s: float
    times_s: list[float] = field(default_factory=list)
    free_at_s: float = 0.0
    waits: int = 0

    def wait_s(self, now: float, most: int) -> float:
        """Seconds to wait before the next try; a try that need not wait is counted."""
        self.seen_s = now
        if now < self.free_at_s:
            return self.free_at_s - now
        self.times_s = [item for item in self.times_s if now - item < WINDOW_S]
        if len(self.times_s) < most:
            self.times_s.append(now)
            return 0.0
        wait_s = min(WINDOW_S * 2.0 ** min(self.waits, 10), LONGEST_WAIT_S)
        self.waits, self.free_at_s, self.times_s = self.waits + 1, now + wait_s, []
        return wait_s


class LoginRateLimiter:
    """Counts login attempts, by address and overall; ``clock`` gives monotonic seconds.

    Attempts are counted before the password is checked, so that concurrent ones count too.
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._of: OrderedDict[str, _Tries] = OrderedDict()
        self._all = _Tries(seen_s=clock())

    def wait_s(self, address: str) -> float:
        """Count a try from this address; the seconds that it must wait first, 0 when it may go on.

        Examples
        --------
        >>> attempts = LoginRateLimiter(clock=lambda: 0.0)
        >>> [attempts.wait_s("192.0.2.7") for _ in range(7)]
        [0.0, 0.0, 0.0, 0.0, 0.0, 60.0, 60.0]
        """
        now, item = self._clock(), network(address)
        tries = self._of.get(item)
        if tries is None or now - tries.seen_s > FORGOTTEN_S:
            tries = self._of[item] = _Tries(seen_s=now)
        self._of.move_to_end(item)
        while len(self._of) > ADDRESSES:
            self._of.popitem(last=False)
        wait_s = tries.wait_s(now, A_MINUTE)
        if wait_s:
            return wait_s
        over_all_s = self._all.wait_s(now, A_MINUTE_OVER_ALL)
        self._all.waits = 0  # many addresses at once wait a minute each time; more would shut everybody out
        return over_all_s

    def succeeded(self, address: str) -> None:
        """Forget the waits of who is in; the tries of this minute count on, or one login would buy endless guesses."""
        tries = self._of.get(network(address))
        if tries is not None:
            tries.waits = 0


def network(address: str) -> str:
    """What counts as one: an IPv4 address, or the network of an IPv6 address."""
    try:
        result = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(result, ipaddress.IPv4Address):
        return str(result)
    if result.ipv4_mapped is not None:
        return str(result.ipv4_mapped)
    return str(ipaddress.ip_network((result, NETWORK_OF_ONE), strict=False))
