"""Looking for a certificate of stability; whatever is found counts only once `verify` has proved it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from itertools import product

import numpy as np
import scipy.linalg

from fmu_builder.errors import CertificateError
from fmu_builder.parameter_set import CommonExclusion, ParameterSet, StabilityCertificate, nested
from identification.arrays import Array
from identification.stability import programme
from identification.stability.verify import NotProvedError, verify

LARGEST_ORDER = 20
"""States of a local model up to which a rate is proved: a matrix per node grows with their square."""
_DIGITS = (28, 36, 44, 52)
"""Bits of the integers that P is rounded to, the first that suffice."""
_GAIN = 0.02
"""Of the slowest frozen decay: what a further programme must gain."""
_PASSES = 6
_EXCLUSION_DIGITS = 40
"""Bits of the integers that Z is rounded to."""
_WORST_MODES = 1e10
"""Condition of the eigenvectors up to which they are used."""
_BACKED_OFF = (0.98, 0.9, 0.7, 0.4, 0.0)
"""Of the decay that was found: exact arithmetic needs some margin."""
_RATE_TOLERANCE = 0.02

Advance = Callable[[str], None]


def _silent(text: str) -> None:
    del text


def found_certificate(
    parameter_set: ParameterSet, rate: float, say: Advance = _silent, or_less: bool = False
) -> StabilityCertificate:
    """Return a certificate that `verify` proves, with the fastest decay that was found.

    Where outputs are blended, or a common P exists, it covers any movement and the rate has no meaning.

    Args:
        parameter_set: The network.
        rate: Of the scheduling variable, its unit per second.
        say: Told what is going on.
        or_less: Where there is none for the rate, take the largest rate that one is found for.

    Raises:
        CertificateError: The network is not of a kind that has one, or none was found; says the largest rate
            that one was found for.
    """
    if parameter_set.blending == "output":
        return _of_local_models(parameter_set)
    search = _Search(parameter_set, say)
    found = search.common() or search.at(rate)
    if found is not None:
        return found
    say(f"nothing found for a rate of {rate:g}, looking for the largest")
    largest = search.largest_rate(rate)
    found = search.at(largest) if largest > 0.0 else None
    if found is not None and or_less:
        return found
    where = f"{parameter_set.name}, stability"
    if found is None:
        what = "no certificate was found for any rate"
        raise CertificateError.of(where, what, "Identify with other validity functions or state coordinates")
    what = f"no certificate was found for a rate of {rate:g}; one was found for {largest:g}"
    raise CertificateError.of(where, what, f"Ask for a rate of {largest:g} or less")


def seems_provable(parameter_set: ParameterSet, rate: float, share: float) -> bool:
    """Whether a certificate is likely: one programme, nothing proved.

    Args:
        parameter_set: A network whose parameters are blended from a node table.
        rate: Of the scheduling variable, its unit per second.
        share: Of the slowest decay at rest, which must be left.

    Raises:
        CertificateError: The network is not of a kind that has a certificate, or unstable at rest.
    """
    return _Search(parameter_set, _silent).seems_provable(rate, share)


def _certificate(parameter_set: ParameterSet, **fields: object) -> StabilityCertificate | None:
    """Return a certificate with these fields when `verify` proves it."""
    certificate = StabilityCertificate(model_hash=parameter_set.model_hash(), **fields)
    try:
        verify(json.loads(parameter_set.replaced(certificate=certificate).canonical_json()))
    except NotProvedError:
        return None
    return certificate


def _rounded(matrices: Array, bits: int) -> tuple[object, ...]:
    """Return symmetric matrices, scaled together and rounded to integers of so many bits."""
    largest = float(np.abs(matrices).max())
    whole = np.rint(0.5 * (matrices + matrices.transpose(0, 2, 1)) * (2.0**bits / largest))
    return tuple(nested(whole + 0.0))  # no negative zero


def _floor(value: float) -> float:
    """Return a number rounded down to three digits."""
    if value <= 0.0:
        return 0.0
    digits = 2 - math.floor(math.log10(value))
    return math.floor(value * 10.0**digits) / 10.0**digits


def _of_local_models(parameter_set: ParameterSet) -> StabilityCertificate:
    """One Stein matrix per local model, with the decay of the slowest."""
    Ts = parameter_set.sample_time
    models = [np.array(model.A) for model in parameter_set.local_models]
    slowest = _frozen_decay(np.array(models), Ts)
    if slowest > 0.0:
        for part in _BACKED_OFF:
            decay = _floor(part * slowest)
            P = np.array([_lyapunov(A, 1.0 - 0.5 * (decay + slowest) * Ts) for A in models])
            P /= np.abs(P).max(axis=(1, 2), keepdims=True)
            for bits in _DIGITS:
                found = _certificate(
                    parameter_set,
                    method="local_models",
                    decay=decay,
                    positions=parameter_set.partition.centres,
                    matrices=_rounded(P, bits),
                )
                if found is not None:
                    return found
    what = f"a local model is unstable, or too near to it (slowest decay {slowest:.3g} 1/s)"
    raise CertificateError.of(f"{parameter_set.name}, stability", what, "Identify stable local models")


def _frozen_decay(models: Array, sample_time: float) -> float:
    """Return the decay of the slowest model if the scheduling variable stood still, 1/s: (1 - |z|) / Ts."""
    return (1.0 - float(np.abs(np.linalg.eigvals(models)).max())) / sample_time


def _lyapunov(A: Array, radius: float) -> Array:
    """Return P with P - (A / radius)' P (A / radius) = 1."""
    return np.asarray(scipy.linalg.solve_discrete_lyapunov((A / radius).T, np.eye(len(A))))


def _balancing(models: Array) -> Array:
    """Return the change to state coordinates in which the modes of the middle model are orthogonal, (n, n).

    Each is scaled so that it acts on the others, in all models, about as much as they act on it.

    Args:
        models: A at the nodes, shape (K, n, n).
    """
    _, vectors = np.linalg.eig(models[len(models) // 2])
    if not np.linalg.cond(vectors) < _WORST_MODES:  # modes that are nearly one have no directions
        return np.eye(models.shape[1])
    inverse = np.linalg.inv(vectors)
    coupling = np.abs(inverse @ models @ vectors).sum(axis=0)
    np.fill_diagonal(coupling, 0.0)
    _, (scale, _) = scipy.linalg.matrix_balance(coupling, permute=False, separate=True)
    inverse /= scale[:, None]
    energy = (inverse.conj().T @ inverse).real
    return np.asarray(np.linalg.cholesky(energy).T)


class _Search:
    """The search for one network whose parameters are blended from a node table.

    It runs in balanced state coordinates: in SI units the programmes end without a solution.
    """

    def __init__(self, parameter_set: ParameterSet, say: Advance) -> None:
        table, where = parameter_set.node_table, f"{parameter_set.name}, stability"
        if table is None:
            mend = "Identify with another validity, or blend outputs"
            raise CertificateError.of(where, "Gaussians that blend parameters have no certificate", mend)
        if parameter_set.state_count > LARGEST_ORDER:
            what = f"models with more than {LARGEST_ORDER} states are not searched"
            raise CertificateError.of(where, what, "Reduce the order, or blend outputs")
        self.set, self.say, self.positions = parameter_set, say, np.array(table.positions)
        self.sample_time = parameter_set.sample_time
        models = np.array([model.A for model in table.models])
        self.slowest = _frozen_decay(models, self.sample_time)
        if not self.slowest > 0.0:
            radius = np.abs(np.linalg.eigvals(models)).max(axis=1)
            node = int(radius.argmax())
            what = f"the model at {self.positions[node]:g} has the spectral radius {radius[node]:.9g}"
            raise CertificateError.of(where, what, "Identify models that decay everywhere in the range")
        self.inward = _balancing(models)  # z = inward x
        self.models = self.inward @ models @ np.linalg.inv(self.inward)
        self.exclusion: CommonExclusion | None = None

    def common(self) -> StabilityCertificate | None:
        """Return a certificate of one P for all nodes; where there is none, keep the reason."""
        found = programme.common_solution(self.models, self.sample_time)
        if isinstance(found, programme.Solution):
            fastest = self._fastest(programme.stein_conditions(self.models), "any rate")
            return None if fastest is None else self._proved(*fastest, method="common")
        if found is not None:
            outward = np.linalg.inv(self.inward)
            Z = _rounded(outward @ found.Z @ outward.T, _EXCLUSION_DIGITS)
            self.exclusion = CommonExclusion(nodes=found.nodes, matrices=Z)
            self.say("no common Lyapunov matrix exists")
        return None

    def at(self, rate: float) -> StabilityCertificate | None:
        """Return a certificate for a rate with the fastest decay found, None without one."""
        asked = self._conditions(rate)
        best = None if asked is None else self._fastest(asked, f"rate {rate:g}")
        if best is None:
            return None
        positions = nested(self.positions[self.knots])
        return self._proved(*best, method="nodes", rate=rate, positions=positions)

    def _fastest(self, asked: programme.Conditions, title: str) -> tuple[Array, float] | None:
        """Return P at the knots with the smallest lambda^2 found, and that; None where none is below 1."""
        decay, best, scale = 0.0, None, np.eye(len(self.inward))
        for number in range(_PASSES):
            shrink = (1.0 - decay * self.sample_time) ** 2
            solution = programme.largest_margin(asked, shrink, self.sample_time, scale)
            if solution is None:
                break
            reached = asked.shrinkage(solution.P)
            gained = (1.0 - math.sqrt(reached)) / self.sample_time - decay
            if not gained > 0.0:
                break
            best, decay, scale = (solution.P, reached), decay + gained, asked.sizes(solution.P)
            self.say(f"{title}: decay {decay:.4g} of {self.slowest:.4g} 1/s")
            if number > 0 and gained < _GAIN * self.slowest:  # the first one knows no scale yet
                break
        return best

    def seems_provable(self, rate: float, share: float) -> bool:
        """Whether the conditions can be kept with this share of the slowest decay."""
        asked = self._conditions(rate)
        if asked is None:
            return False
        shrink = (1.0 - share * self.slowest * self.sample_time) ** 2
        found = programme.largest_margin(asked, shrink, self.sample_time, np.eye(len(self.inward)))
        return found is not None and asked.shrinkage(found.P) < shrink

    def largest_rate(self, below: float) -> float:
        """Return the largest rate that conditions can be kept for, to 2 %; 0 without one."""
        widest = float(np.diff(self.positions).min()) / self.sample_time
        low, high = 0.0, min(below, widest)
        while high - low > _RATE_TOLERANCE * high:
            middle = 0.5 * (low + high)
            usable = self.seems_provable(middle, 0.0)
            low, high = (middle, high) if usable else (low, middle)
            self.say(f"rate {middle:.3g}: {'feasible' if usable else 'nothing found'}")
            if high < 1e-3 * widest:
                break
        return _floor(low)

    @property
    def knots(self) -> Array:
        """Nodes between which P is linear."""
        return programme.knots_of(len(self.positions))

    def _conditions(self, rate: float) -> programme.Conditions | None:
        move = rate * self.sample_time
        if not 0.0 < move * (1.0 + 2.0**-29) <= float(np.diff(self.positions).min()):
            return None
        return programme.conditions(self.models, self.positions, move, self.knots)

    def _proved(self, P: Array, shrink: float, **fields: object) -> StabilityCertificate | None:
        """Return the certificate of P in the network's own coordinates, rounded as coarsely as it holds."""
        own = self.inward.T @ P @ self.inward
        reached = (1.0 - math.sqrt(shrink)) / self.sample_time
        # the reason against a common P is worth telling, but must not cost the certificate
        reasons = (self.exclusion, None) if self.exclusion is not None else (None,)
        for exclusion, part, bits in product(reasons, _BACKED_OFF, _DIGITS):
            found = _certificate(
                self.set,
                decay=_floor(part * reached),
                matrices=_rounded(own, bits),
                exclusion=exclusion,
                **fields,
            )
            if found is not None:
                return found
        return None
