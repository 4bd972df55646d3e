"""Whether the parts of a bundle belong together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Container, Sequence

    from tsis.records.values import StoredEstimate, StoredPress, Target


def require_presses(target: Target, presses: Sequence[StoredPress]) -> None:
    """Refuse presses of another target, or that disagree about a frame that they share.

    Raises
    ------
    InputError
        Saying which press, and why.
    """
    _require_different([press.id for press in presses], "press")
    sizes: dict[str, tuple[int, int]] = {}
    for number, press in enumerate(presses, start=1):
        where = f"press {number}"
        _require_own(target, press.target, where)
        if sizes.setdefault(press.frame, (press.rows, press.columns)) != (press.rows, press.columns):
            raise InputError(f"{where} must be of the size of its frame, {sizes[press.frame]}; another press says so")


def require_estimates(target: Target, presses: Sequence[StoredPress], estimates: Sequence[StoredEstimate]) -> None:
    """Refuse estimates of another target, or from presses that are not there.

    Raises
    ------
    InputError
        Saying which estimate, and why.
    """
    _require_different([stored.id for stored in estimates], "estimate")
    known = {press.id for press in presses}
    for number, stored in enumerate(estimates, start=1):
        _require_own(target, stored.target, f"estimate {number}")
        if missing := [each for each in stored.presses if each not in known]:
            raise InputError(f"estimate {number} must rest on presses of the bundle; got {missing[0]!r:.80}")


def require_calibrations(
    presses: Sequence[StoredPress], estimates: Sequence[StoredEstimate], calibrations: Container[str]
) -> None:
    """Refuse a bundle that lacks a calibration which it cites.

    Raises
    ------
    InputError
        Saying which.
    """
    cited = [press.calibration for press in presses] + [stored.calibration for stored in estimates]
    for each in cited:
        if each and each not in calibrations:
            raise InputError(f"every calibration that is cited must be in the bundle; {each!r:.80} is not")


def _require_different(identities: list[str], what: str) -> None:
    stored = [each for each in identities if each]  # what was never stored has none
    if len(set(stored)) != len(stored):
        raise InputError(f"every {what} must have an identity of its own; got one twice")


def _require_own(target: Target, cited: str, where: str) -> None:
    if cited and target.id and cited != target.id:
        raise InputError(f"{where} must be of the target {target.id!r:.80}; got {cited!r:.80}")
