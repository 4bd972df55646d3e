"""How often somebody may try, on a clock that the test moves."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tsis.console.auth._rate_limit import (
    A_MINUTE,
    A_MINUTE_OVER_ALL,
    ADDRESSES,
    FORGOTTEN_S,
    LONGEST_WAIT_S,
    LoginRateLimiter,
    network,
)


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def tried(attempts: LoginRateLimiter, clock: Clock, *, for_s: float, address: str = "192.0.2.7") -> int:
    """How many tries somebody has who tries each second."""
    free = 0
    for _ in range(int(for_s)):
        free += attempts.wait_s(address) == 0
        clock.now_s += 1
    return free


def test_five_a_minute_then_waits_that_double() -> None:
    clock = Clock()
    attempts = LoginRateLimiter(clock=clock)
    waits = []
    for _ in range(8):
        while (wait_s := attempts.wait_s("192.0.2.7")) == 0:
            pass
        waits.append(wait_s)
        clock.now_s += wait_s
    assert waits == [60, 120, 240, 480, 960, 1920, 3600, 3600]


def test_a_day_of_tries_is_a_few_dozen_guesses() -> None:
    clock = Clock()
    free = tried(LoginRateLimiter(clock=clock), clock, for_s=86400)
    assert 100 < free < 5 * (7 + 24) + 5


def test_slow_people_never_wait() -> None:
    clock = Clock()
    attempts = LoginRateLimiter(clock=clock)
    for _ in range(500):
        assert attempts.wait_s("192.0.2.7") == 0
        clock.now_s += 60 / A_MINUTE


def test_addresses_do_not_wait_for_each_other_until_there_are_many() -> None:
    attempts = LoginRateLimiter(clock=lambda: 0.0)
    addresses = [f"192.0.2.{number}" for number in range(1, 50)]
    waits = [attempts.wait_s(item) for item in addresses]
    assert waits == [0.0] * A_MINUTE_OVER_ALL + [60.0] * (len(addresses) - A_MINUTE_OVER_ALL)


def test_many_addresses_shut_nobody_out_for_longer_than_a_minute() -> None:
    clock = Clock()
    attempts = LoginRateLimiter(clock=clock)
    for round_ in range(20):
        for number in range(100):
            assert attempts.wait_s(f"10.0.{round_}.{number}") <= 60
        clock.now_s += 60


def next_wait_s(attempts: LoginRateLimiter) -> float:
    """How long somebody waits who tries until he must."""
    while (wait_s := attempts.wait_s("192.0.2.7")) == 0:
        pass
    return wait_s


def test_who_is_in_waits_no_longer_than_a_minute_again() -> None:
    clock = Clock()
    attempts = LoginRateLimiter(clock=clock)
    for expected in (60, 120, 240):
        assert next_wait_s(attempts) == expected
        clock.now_s += expected
    assert attempts.wait_s("192.0.2.7") == 0
    attempts.succeeded("192.0.2.7")
    assert next_wait_s(attempts) == 60


def test_a_login_of_ones_own_buys_no_more_guesses() -> None:
    attempts = LoginRateLimiter(clock=lambda: 0.0)
    free = 0
    for _ in range(100):
        free += attempts.wait_s("192.0.2.7") == 0
        attempts.succeeded("192.0.2.7")
    assert free == A_MINUTE


def test_who_stays_away_begins_anew_and_who_goes_on_does_not() -> None:
    clock = Clock()
    attempts = LoginRateLimiter(clock=clock)
    for expected in (60, 120):
        assert next_wait_s(attempts) == expected
        clock.now_s += expected
    clock.now_s += FORGOTTEN_S / 2
    assert attempts.wait_s("192.0.2.7") == 0
    clock.now_s += FORGOTTEN_S - 1
    assert next_wait_s(attempts) == 240
    clock.now_s += FORGOTTEN_S + 1
    assert next_wait_s(attempts) == 60


def test_what_is_remembered_does_not_grow() -> None:
    clock = Clock()
    attempts = LoginRateLimiter(clock=clock)
    for number in range(ADDRESSES + 500):
        attempts.wait_s(f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}")
        clock.now_s += 3
    assert len(attempts._of) == ADDRESSES


def test_a_customer_with_a_network_is_one() -> None:
    assert network("2001:db8::1") == network("2001:db8::ffff:1") != network("2001:db8:0:1::1")
    assert network("::ffff:192.0.2.7") == network("192.0.2.7")
    assert network("fe80::1%eth0") == network("fe80::2%eth1")


@given(st.lists(st.floats(0, 5000), max_size=60))
def test_nobody_waits_longer_than_is_said(steps: list[float]) -> None:
    clock = Clock()
    attempts = LoginRateLimiter(clock=clock)
    for step in steps:
        clock.now_s += step
        wait_s = attempts.wait_s("192.0.2.7")
        assert 0 <= wait_s <= LONGEST_WAIT_S
        clock.now_s += wait_s
    assert attempts.wait_s("192.0.2.7") <= LONGEST_WAIT_S
