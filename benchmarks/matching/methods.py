"""Coherent point drift of other programs, pycpd, biocpd and probreg, for comparison with the methods here.

No library is a dependency. All leave the scaling of the sets to the user, which matters more than their
parameters. So each has several configurations, and a method is compared with the best of them.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from benchmarks.matching.runs import MatchOutcome

from tsis.errors import MissingExtraError
from tsis.matching.registration import METHODS, register
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    from benchmarks.matching.distort import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A configuration of another library."""

    library: Literal["pycpd", "biocpd", "probreg"]  # name of its installation and import
    # ``"apart"``: each set has its own mean and root-mean-square radius; ``"common"``: its own mean and the source's
    # radius; ``"raw"``: no scaling
    scaling: Literal["apart", "common", "raw"]
    outliers: float = 0.1  # fraction of the target points that the library assumes to be outliers, in [0, 1)

    def absent(self) -> str:
        """Reason why it is not available; empty when it is."""
        try:
            importlib.import_module(self.library)
        except ModuleNotFoundError as error:
            return f"{error.name} is not installed"
        except ImportError as error:  # a missing system library
            return f"{self.library} cannot be loaded: {error}"
        return ""

    def transformed(self, source: Floats, target: Floats) -> Floats:
        """The source after the library's transform, shape (n, d), in the target's unit.

        Raises `MissingExtraError` when the library is not installed or does not load.
        """
        absent = self.absent()
        if absent:
            raise MissingExtraError(
                f"{self.library} must be installed to be compared with; {absent} (pip install {self.library})"
            )
        centre, scale = _frame(source, self.scaling)
        target_centre, target_scale = _frame(target, self.scaling)
        if self.scaling == "common":
            target_scale = scale
        transformed = LIBRARIES[self.library](
            (source - centre) / scale, (target - target_centre) / target_scale, self.outliers
        )
        return np.asarray(transformed * target_scale + target_centre)


PEERS: dict[str, Peer] = {
    "pycpd": Peer(library="pycpd", scaling="apart"),
    "pycpd-common": Peer(library="pycpd", scaling="common"),
    "pycpd-outliers": Peer(library="pycpd", scaling="common", outliers=0.5),
    "pycpd-raw": Peer(library="pycpd", scaling="raw"),
    "biocpd": Peer(library="biocpd", scaling="apart"),
    "biocpd-common": Peer(library="biocpd", scaling="common"),
    "biocpd-outliers": Peer(library="biocpd", scaling="common", outliers=0.5),
    "probreg": Peer(library="probreg", scaling="apart"),
    "probreg-common": Peer(library="probreg", scaling="common"),
}


def peer(name: str) -> Peer:
    """The configuration of that name.

    Examples
    --------
    >>> peer("pycpd-raw").scaling
    'raw'
    """
    return PEERS[require_one_of("peer", name, PEERS)]


def _frame(points: Floats, scaling: str) -> tuple[Floats, float]:
    """Centre and unit of a scaling."""
    if scaling == "raw":
        return np.zeros(points.shape[1]), 1.0
    centre = points.mean(axis=0)
    return centre, float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()))


def _pycpd(source: Floats, target: Floats, outliers: float) -> Floats:
    pycpd: Any = importlib.import_module("pycpd")
    return np.asarray(pycpd.DeformableRegistration(X=target, Y=source, w=outliers).register()[0])


def _biocpd(source: Floats, target: Floats, outliers: float) -> Floats:
    biocpd: Any = importlib.import_module("biocpd")
    # All pairs, as in the paper: its k nearest neighbours end in poorer optima on some hundred points.
    drift = biocpd.DeformableRegistration(X=target, Y=source, w=outliers, use_kdtree=False)
    return np.asarray(drift.register()[0])


def _probreg(source: Floats, target: Floats, outliers: float) -> Floats:
    probreg: Any = importlib.import_module("probreg.cpd")
    result = probreg.registration_cpd(source, target, tf_type_name="nonrigid", w=outliers, maxiter=100)
    return np.asarray(result.transformation.transform(source))


LIBRARIES = {"pycpd": _pycpd, "biocpd": _biocpd, "probreg": _probreg}
OWN_METHODS = tuple(METHODS)
RIVAL_METHODS = ("cpd", *PEERS)  # all configurations of coherent point drift


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkMethod:
    """A method by its name; it can be pickled for another process."""

    name: str  # one of `OWN_METHODS`, or of `benchmarks.matching.methods.PEERS`

    def __post_init__(self) -> None:
        require_one_of("method", self.name, (*OWN_METHODS, *PEERS))

    def absent(self) -> str:
        """Reason why it is not available; empty when it is."""
        return peer(self.name).absent() if self.name in PEERS else ""

    def __call__(self, source: Floats, target: Floats, *, rng: np.random.Generator) -> MatchOutcome:
        """Match two point sets, shapes (n, d) and (m, d).

        Results of low confidence, which are not reliable, are returned too, as by other programs.
        """
        if self.name in PEERS:
            return MatchOutcome(transformed=peer(self.name).transformed(source, target), reliable=None)
        result = register(source, target, method=self.name, rng=rng)
        return MatchOutcome(transformed=result.untrusted.moved, reliable=result.reliable)
