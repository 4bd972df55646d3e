"""How often somebody may try to log in, on a clock that the test moves."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tsis.console.auth import A_MINUTE, A_MINUTE_OVER_ALL, WINDOW_S, LoginBound, network


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def tried(bound: LoginBound, clock: Clock, *, for_s: float, addresses: int = 1) -> int:
    """How many tries somebody has who tries each second from each of so many addresses."""
    free = 0
    for _ in range(int(for_s)):
        free += sum(bound.wait_s(f"192.0.2.{number}") == 0 for number in range(addresses))
        clock.now_s += 1
    return free


def test_an_address_has_five_tries_a_minute_and_all_have_thirty() -> None:
    clock = Clock()
    assert tried(LoginBound(clock=clock), clock, for_s=3600) == 60 * A_MINUTE
    assert tried(LoginBound(clock=clock), clock, for_s=3600, addresses=50) == 60 * A_MINUTE_OVER_ALL


def test_guessing_takes_longer_than_any_password_lasts() -> None:
    """A thousand years of tries, from any number of addresses, against twelve letters."""
    assert A_MINUTE_OVER_ALL * 60 * 24 * 365 * 1000 < 26**12 / 1e6


def test_slow_people_never_wait() -> None:
    clock = Clock()
    bound = LoginBound(clock=clock)
    for _ in range(500):
        assert bound.wait_s("192.0.2.7") == 0
        clock.now_s += 60 / A_MINUTE


def test_addresses_do_not_wait_for_each_other_until_there_are_many() -> None:
    bound = LoginBound(clock=lambda: 0.0)
    waits = [bound.wait_s(f"192.0.2.{number}") for number in range(1, 50)]
    assert waits == [0.0] * A_MINUTE_OVER_ALL + [60.0] * (49 - A_MINUTE_OVER_ALL)


def test_many_addresses_shut_nobody_out_for_longer_than_a_minute() -> None:
    clock = Clock()
    bound = LoginBound(clock=clock)
    for round_ in range(20):
        for number in range(100):
            assert bound.wait_s(f"10.0.{round_}.{number}") <= 60
        clock.now_s += 60


def test_what_is_remembered_does_not_grow() -> None:
    clock = Clock()
    bound = LoginBound(clock=clock)
    for number in range(10_000):
        bound.wait_s(f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}")
        clock.now_s += 0.01
    assert len(bound._tries) <= A_MINUTE_OVER_ALL


def test_a_customer_with_a_network_is_one() -> None:
    assert network("2001:db8::1") == network("2001:db8::ffff:1") != network("2001:db8:0:1::1")
    assert network("::ffff:192.0.2.1") == network("192.0.2.1")
    assert network("fe80::1%eth0") == network("fe80::2%eth1")


@given(st.lists(st.floats(0, 5000), max_size=60))
def test_who_waits_as_long_as_is_said_may_go_on(steps: list[float]) -> None:
    clock = Clock()
    bound = LoginBound(clock=clock)
    for step in steps:
        clock.now_s += step
        wait_s = bound.wait_s("192.0.2.7")
        assert 0 <= wait_s <= WINDOW_S
        if wait_s:
            clock.now_s += wait_s + 1e-6
            assert bound.wait_s("192.0.2.7") == 0
