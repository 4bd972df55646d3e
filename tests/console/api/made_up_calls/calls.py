"""Calls made up from the console's description: as it allows, as it forbids, and hostile; the answers judged.

A fault is an answer from 500 on that is not documented, an answer that the description does not tell of, or a refusal
of what it allows.
"""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import requests
import schemathesis
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.core.failures import Failure, FailureGroup
from schemathesis.core.parameters import ParameterLocation
from schemathesis.specs.openapi import checks
from tests.console.api.made_up_calls.held_bench import CONTROL, HeldBench
from tests.console.api.made_up_calls.hostile import hostile_body, hostile_text

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy
    from schemathesis import Case

ACCEPTED, SERVER_ERROR = 202, 500
EXPECTED = (501, 503, 507)  # documented: a library is missing, the camera or a file is away, the disk is full
REFUSED = ["400", "401", "403", "404", "405", "406", "409", "413", "415", "421", "422", "428"]
PATIENCE_S = 600.0
SLOW = 0.1  # share of the reports that are of a target that there is: drawing one takes seconds
CHECKS = [
    checks.status_code_conformance,
    checks.content_type_conformance,
    checks.response_headers_conformance,
    checks.response_schema_conformance,
]
WAYS = ("as described", "as forbidden", "hostile")


@dataclass(slots=True, kw_only=True)
class Tally:
    """Answers by (way of making calls up, status), and faults by their sentence."""

    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)

    @property
    def cases(self) -> int:
        """How many in all."""
        return self.statuses.total()


class MadeUpCalls:
    """Calls of a console, made up from its own description.

    Parameters
    ----------
    address, key
        Where it listens, and the header that lets in.
    """

    def __init__(self, address: str, key: dict[str, str]) -> None:
        self.address, self.key = address, key
        self.session = requests.Session()
        self.session.headers.update(key)
        self.bench = HeldBench(address, key)
        self.tally = Tally()
        self._strategies: dict[tuple[str, bool], SearchStrategy[Case[Any]] | None] = {}
        config = schemathesis.Config.from_dict(
            {
                "checks": {"negative_data_rejection": {"expected-statuses": REFUSED}},
                "generation": {"with-security-parameters": False},  # who is let in is tested elsewhere
            }
        )
        url = f"{address}/api/openapi.json"
        self.operations: list[Any] = [
            result.ok()  # type: ignore[union-attr]
            for result in schemathesis.openapi.from_url(url, headers=key, config=config).get_all_operations()
        ]

    def close(self) -> None:
        """Let go of the connections."""
        self.session.close()
        self.bench.close()

    def round(self, number: int, *, each: int) -> None:
        """At most ``each`` cases of each way for each call; every fifth round by somebody who holds no camera."""
        rng = random.Random(number)
        self.bench.know(number)
        held = number % 5 != 4
        for operation in self.operations:
            if held and rng.random() < 0.7:
                self.bench.run()
            elif not held:
                self.bench.release()
            for way in WAYS:
                self._several(operation, way, each=each, number=number, held=held)
        self.bench.take()
        self.bench.end_work()

    def _several(self, operation: Any, way: str, *, each: int, number: int, held: bool) -> None:
        strategy = self._strategy(operation, forbidden=way == WAYS[1])
        if strategy is None:
            return
        rng = random.Random(f"{number} {way} {operation.label}")
        known = self.bench.known()

        @seed(rng.getrandbits(64))
        @settings(
            max_examples=each,
            phases=(Phase.generate,),
            database=None,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        )
        @given(case=strategy)
        def send(case: Case[Any]) -> None:
            self._one(case, way, rng, known, held=held)

        try:
            send()
        except Unsatisfiable:  # whatever a header holds is text, as it is described
            self._strategies[operation.label, way == WAYS[1]] = None

    def _strategy(self, operation: Any, *, forbidden: bool) -> SearchStrategy[Case[Any]] | None:
        """What makes cases up, made once; None where nothing of a call can be forbidden."""
        place = operation.label, forbidden
        if place not in self._strategies:
            mode = GenerationMode.NEGATIVE if forbidden else GenerationMode.POSITIVE
            able = not forbidden or any((operation.body, operation.query, operation.headers, operation.path_parameters))
            self._strategies[place] = operation.as_strategy(generation_mode=mode) if able else None
        return self._strategies[place]

    def _one(self, case: Case[Any], way: str, rng: random.Random, known: dict[str, Any], *, held: bool) -> None:
        if way != WAYS[1] and rng.random() < (SLOW if "/report." in case.path else 0.6):
            _name_what_is_there(case, rng, known)
            if case.operation.body:
                case.body = self.bench.sound(case.operation.label, case.body, rng)
        expected = case.as_transport_kwargs(base_url=f"{self.address}/api")
        headers = dict(expected.pop("headers") or {})
        if held and not _is_forbidden(case, ParameterLocation.HEADER):
            headers |= self.bench.act
        if way == WAYS[2]:
            _spoil(expected, headers, case, rng)
        try:
            answer = self.session.request(**expected, headers=headers, timeout=PATIENCE_S, allow_redirects=False)
        except (requests.exceptions.InvalidHeader, UnicodeError):  # cannot be sent at all
            return
        self.tally.statuses[way, answer.status_code] += 1
        if case.operation.label == "POST /v1/sequence" and answer.status_code == ACCEPTED:
            self.bench.end_sequence()
        for fault in self._faults(case, answer, way):
            self.tally.faults[f"{fault} | {case.operation.label}"] += 1

    def _faults(self, case: Case[Any], answer: requests.Response, way: str) -> list[str]:
        status = answer.status_code
        if status >= SERVER_ERROR and status not in EXPECTED:
            return [f"server error {status}: {answer.text[:200]}"]
        found = []
        if status >= 400 and "json" in answer.headers.get("content-type", ""):
            result = answer.json()
            if set(result) != {"error", "kind"} or "\n" in result["error"] or "Traceback (" in result["error"]:
                found.append(f"no sentence: {answer.text[:200]} {answer.request.url}")
            if way == WAYS[0] and status == 422 and result.get("kind") == "RequestValidationError":
                found.append(f"as described, and refused: {result['error']} {case.body!r:.200} {case.query!r:.80}")
        judged = [*CHECKS, checks.negative_data_rejection] if way == WAYS[1] else CHECKS
        try:
            case.validate_response(answer, checks=judged)
        except FailureGroup as group:
            found += [" ".join(str(each).split())[:300] for each in group.exceptions]
        except Failure as failure:
            found.append(" ".join(str(failure).split())[:300])
        return found


def made_up(address: str, key: dict[str, str], *, cases: int, each: int = 3, seed: int = 1) -> Tally:
    """At least so many cases, ``each`` for each call and way in a round, against a console that listens there."""
    calls = MadeUpCalls(address, key)
    try:
        number = seed * 1000
        while calls.tally.cases < cases:
            calls.round(number, each=each)
            number += 1
    finally:
        calls.close()
    return calls.tally


def _is_forbidden(case: Case[Any], place: ParameterLocation) -> bool:
    """Whether what is wrong with a case is wrong there."""
    component = None if case.meta is None else case.meta.components.get(place)
    return component is not None and component.mode.is_negative


def _name_what_is_there(case: Case[Any], rng: random.Random, known: dict[str, Any]) -> None:
    """Have the address name a target, a press or a job that there is."""
    parts = case.path_parameters or {}
    for name in parts:
        kind = name if name == "number" else "job" if "/jobs/" in case.path else "press"
        if known[kind]:
            parts[name] = rng.choice(known[kind])
    case.path_parameters = parts


def _spoil(wanted: dict[str, Any], headers: dict[str, str], case: Case[Any], rng: random.Random) -> None:
    """Make of a sound call one that nobody would write."""
    if case.operation.body and rng.random() < 0.8:
        content, kind = hostile_body(wanted.pop("json", None), rng)
        wanted.pop("data", None)
        wanted["data"] = content
        headers.pop("Content-Type", None)
        if kind:
            headers["Content-Type"] = kind
        return
    names = [parameter.name for parameter in case.operation.query]
    address, _, _ = wanted["url"].partition("?")
    wanted.pop("params", None)
    query = "&".join(f"{name}={hostile_text(rng)}" for name in [*names, "more"])
    parts = address.split("/")
    if case.path_parameters and rng.random() < 0.7:
        given = [at for at, part in enumerate(parts) if part in {str(value) for value in case.path_parameters.values()}]
        if given:
            parts[rng.choice(given)] = hostile_text(rng)
    wanted["url"] = "/".join(parts) + (f"?{query}" if rng.random() < 0.5 else "")
    if rng.random() < 0.3:
        headers[CONTROL] = rng.choice(["\x7f", "0" * 4000, "ü", "nobody"])
