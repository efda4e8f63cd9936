"""The cost of eq. 3.39 of a blended surrogate over data, as a function of everything that is estimated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from fmu_builder.parameter_set import Partition, warp_rises
from identification.arrays import Array
from identification.surrogate.affine import OFFSETS
from identification.surrogate.chain import OUTPUT_MATRIX, OUTPUT_NAMES, Head
from identification.surrogate.least_squares import NormalEquations
from identification.surrogate.recursion import BlendedModels, Experiment, Observation, run
from identification.surrogate.structure import Structure
from identification.validity import weights

SIGNALS = ("xi", "xi_dot", "zeta", "zeta_dot", "F_H", "F_p")
"""The signals of the cost, eq. 3.39, in the order used here."""

DEVIATION_OUTPUT = "zeta"
"""The output whose deviation from rest may schedule beside the height."""

_LARGEST_GAIN = 20.0
"""Bound of kappa, m/m."""

_LARGEST_WARP = 2.0
"""Bound of both numbers of the warp in units of the half range; where it would fall the cost is infinite."""

_OFFSET_SIZES = np.array([one.size for one in OFFSETS])

_WARP_STEP = 1e-5
"""Of the central differences of the weights, smooth functions of the warp."""

_STRETCHES = 50
"""Of all data, whose gradients count as independent when the search asks how sure it is."""

Free = Literal["all", "offsets", "schedule"]
"""What may move: everything, the affine offsets only, or only how theta is blended (warp and kappa)."""


@dataclass(frozen=True)
class NetworkParameters:
    """Everything that is estimated of a surrogate network.

    Attributes:
        theta: Parameters of the local models, (M, P).
        offsets: Affine offsets of the local models in the order of `affine.OFFSETS`, (M, Q); Q is 0 in
            scheduled-equilibrium form.
        warp: v0 and v1 of the warped height over which theta is blended.
        gain: kappa of the deviation that schedules beside the height.
    """

    theta: Array
    offsets: Array = field(default_factory=lambda: np.zeros((0, 0)))
    warp: tuple[float, float] = (0.0, 0.0)
    gain: float = 0.0


def observation_matrix(head: Head) -> Array:
    """Return E, (6, 6): the signals of eq. 3.39 from the state; F_p without its part -k_E eta."""
    force_head = np.array([-head.k_C, -head.c_C, head.k_C, head.c_C, 0.0, 0.0])
    force_contact = np.array([head.k_E, 0.0, 0.0, 0.0, 0.0, 0.0])
    return np.vstack([OUTPUT_MATRIX, force_head, force_contact])


def criterion_weights(deviations: Array, contact_force_weight: float) -> Array:
    """Return the weights of the squared residuals of `SIGNALS`, (6,), after eq. 3.39.

    Q_p, Q_v and Q_f balance magnitudes: each is 1 / s^2 with s the mean of the standard deviations of the two
    signals of its kind (the text gives s itself, which would enlarge what is large). The standard deviations
    are those of the deviations from the static map: the slow travel through the whole range says nothing
    about dynamics.

    Args:
        deviations: Measured signals less their static values, (N, 6).
        contact_force_weight: Q_Fp.
    """
    spread = deviations.std(axis=0)
    weights = np.empty(len(SIGNALS))
    for kind in (("xi", "zeta"), ("xi_dot", "zeta_dot"), ("F_H", "F_p")):
        columns = [SIGNALS.index(name) for name in kind]
        weights[columns] = 1.0 / max(float(spread[columns].mean()), 1e-150) ** 2
    weights[SIGNALS.index("F_p")] *= contact_force_weight
    return weights


@dataclass(frozen=True)
class ThetaBlend:
    """Where and how theta is blended.

    Attributes:
        positions: Nodes at which the blended theta is discretised, ascending, (K,).
        partition: Centres and validity functions; its warp is replaced.
    """

    positions: Array
    partition: Partition

    @property
    def reach(self) -> float:
        """Half the range."""
        return 0.5 * (self.partition.range[1] - self.partition.range[0])

    def shares(self, warp: tuple[float, float]) -> Array:
        """Return the weight of every local model at the nodes, (K, M)."""
        if self.partition.validity != "cubic_warp":
            return weights(self.partition, self.positions)
        return weights(self.partition.model_copy(update={"warp": warp}), self.positions)

    def share_slopes(self, warp: tuple[float, float]) -> Array:
        """Return the derivatives of `shares` to both numbers over the half range, (2, K, M)."""
        slopes = []
        for k, unit in enumerate((1.0 / self.reach, 1.0 / self.reach**2)):
            step = np.eye(2)[k] * _WARP_STEP * unit
            up, down = (self.shares((warp[0] + s * step[0], warp[1] + s * step[1])) for s in (1.0, -1.0))
            slopes.append((up - down) / (2.0 * _WARP_STEP))
        return np.stack(slopes)


@dataclass(frozen=True)
class OutputErrorProblem:
    """Cost of eq. 3.39 of a blended surrogate as a function of everything that is estimated.

    The search vector holds, local model by local model, the search coordinates of theta and the offsets over
    their sizes, and at its end the warp over the half range, and kappa, where they are free.

    Attributes:
        structure: Which chain.
        head: The collector head.
        sample_time: Ts, s.
        experiments: Data.
        observation: Observed signals and weights.
        blend: Theta blending; None: the matrices are blended with the weights of the experiments.
        affine: Offsets of every local model instead of the scheduled equilibrium; matrices blended.
        warp_free: Whether the warp is estimated; theta blending only.
        gain_free: Whether kappa is estimated; theta blending only.
    """

    structure: Structure
    head: Head
    sample_time: float
    experiments: Sequence[Experiment]
    observation: Observation
    blend: ThetaBlend | None = None
    affine: bool = False
    warp_free: bool = False
    gain_free: bool = False

    @property
    def local_models(self) -> int:
        """Number of local models M."""
        if self.blend is not None:
            return len(self.blend.partition.centres)
        return int(self.experiments[0].blend.shape[1])

    @property
    def rows(self) -> int:
        """Samples of all experiments."""
        return sum(len(experiment.scheduling) for experiment in self.experiments)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the search coordinates: `name[local model]`, then v0, v1, kappa."""
        own = [*self.structure.names, *(one.name for one in OFFSETS if self.affine)]
        local = [f"{name}[{k + 1}]" for k in range(self.local_models) for name in own]
        return (*local, *(("v0", "v1") if self.warp_free else ()), *(("kappa",) if self.gain_free else ()))

    @property
    def schedule_size(self) -> int:
        """How many search coordinates say how theta is blended."""
        return 2 * self.warp_free + self.gain_free

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bound of the search vector."""
        schedule = np.array([_LARGEST_WARP] * (2 * self.warp_free) + [_LARGEST_GAIN] * self.gain_free)
        limits = []
        for side, own in enumerate(self.structure.bounds):
            offsets = [one.bounds[side] / one.size for one in OFFSETS] if self.affine else []
            local = np.tile([*own, *offsets], self.local_models)
            limits.append(np.concatenate([local, (-schedule, schedule)[side]]))
        return limits[0], limits[1]

    def to_search(self, parameters: NetworkParameters) -> Array:
        """Return the search vector; missing offsets are zero."""
        rows = self.structure.to_search(parameters.theta)
        if self.affine:
            rows = np.hstack([rows, self._offsets(parameters) / _OFFSET_SIZES])
        schedule: list[float] = []
        if self.warp_free and self.blend is not None:
            reach = self.blend.reach
            schedule += [parameters.warp[0] * reach, parameters.warp[1] * reach**2]
        if self.gain_free:
            schedule.append(parameters.gain)
        return np.concatenate([rows.ravel(), schedule])

    def from_search(self, search: Array, fixed: NetworkParameters) -> NetworkParameters:
        """Return what a search vector stands for; warp and kappa are those of `fixed` if not free."""
        local, schedule = np.split(search, [search.size - self.schedule_size])
        rows, count = local.reshape(self.local_models, -1), len(self.structure.parameters)
        warp = fixed.warp
        if self.warp_free and self.blend is not None:
            reach = self.blend.reach
            warp = (float(schedule[0]) / reach, float(schedule[1]) / reach**2)
        return NetworkParameters(
            self.structure.from_search(rows[:, :count]),
            rows[:, count:] * _OFFSET_SIZES if self.affine else np.zeros((0, 0)),
            warp,
            float(schedule[-1]) if self.gain_free else fixed.gain,
        )

    @property
    def linear(self) -> Array:
        """One for the entries of theta that are searched without a logarithm, else zero."""
        own = [*self.structure.linear, *np.zeros(len(OFFSETS) * self.affine)]
        return np.concatenate([np.tile(own, self.local_models), np.zeros(self.schedule_size)])

    def moved(self, search: Array, step: Array) -> Array:
        """Return the search vector moved by a step, theta along the curves of `Structure.moved`."""
        ends = np.asarray(search + step)
        size, count = search.size - self.schedule_size, len(self.structure.parameters)
        rows, steps = (one[:size].reshape(self.local_models, -1)[:, :count] for one in (search, step))
        ends[:size].reshape(self.local_models, -1)[:, :count] = self.structure.moved(rows, steps)
        return ends

    def possible(self, parameters: NetworkParameters) -> bool:
        """Whether the warped height rises over the whole range."""
        return self.blend is None or warp_rises(parameters.warp, self.blend.reach)

    def _offsets(self, parameters: NetworkParameters) -> Array:
        if not self.affine or parameters.offsets.size:
            return parameters.offsets
        return np.zeros((len(parameters.theta), len(OFFSETS)))

    def models(self, parameters: NetworkParameters, slopes: bool, free: Free = "all") -> BlendedModels:
        """Return what is interpolated, with derivatives if `slopes`.

        Args:
            parameters: Theta and what belongs to it.
            slopes: Whether derivatives are wanted.
            free: `schedule`: derivatives to warp and kappa only.
        """
        theta = parameters.theta
        shares = np.zeros((0, 0)) if self.blend is None else self.blend.shares(parameters.warp)
        if self.blend is not None:
            theta = self.structure.blended(theta, shares)
        local = self.structure.discretise(theta, self.head, self.sample_time, slopes)
        used = slice(None) if self.affine else slice(1, None)
        still = 0.0 if self.affine else 1.0  # no equilibrium is scheduled
        chain = self.structure.slope(theta)[:, : local.dA.shape[1]]
        offsets, inputs = self._offsets(parameters), local.B.shape[-1]
        models = BlendedModels(
            *(local.A, local.B[..., used], local.g * still),
            np.moveaxis(local.dA, 1, -1) * chain[:, None, None, :],
            np.moveaxis(local.dB[..., used], 1, -1) * chain[:, None, None, :],
            np.moveaxis(local.dg, 1, -1) * chain[:, None, :] * still,
            shares=shares,
            positions=np.zeros(0) if self.blend is None else self.blend.positions,
            gain=parameters.gain,
            deviation_state=OUTPUT_NAMES.index(DEVIATION_OUTPUT),
            gain_column=self.gain_free and slopes,
            input_offsets=offsets[:, :inputs],
            output_offsets=offsets[:, inputs:],
        )
        if not slopes or self.blend is None or not (self.warp_free or free == "schedule"):
            return models
        moved = np.zeros((0, *shares.shape))
        if self.warp_free:
            moved = self.blend.share_slopes(parameters.warp)
        directions = np.einsum("ckm,mp->kcp", moved, self.structure.to_search(parameters.theta))
        if free != "schedule":
            return replace(models, directions=directions)
        # Theta does not move: the few columns left are those of one local model with as many parameters.
        return replace(
            models,
            dA=np.einsum("krsp,kcp->krsc", models.dA, directions),
            dB=np.einsum("krsp,kcp->krsc", models.dB, directions),
            dg=np.einsum("krp,kcp->krc", models.dg, directions),
            shares=np.ones((len(shares), 1)),
        )

    def column_sizes(self) -> Array:
        """Return what the columns of the recursion are multiplied by: units of the offsets in the search."""
        own = [*np.ones(len(self.structure.parameters)), *(_OFFSET_SIZES if self.affine else ())]
        return np.concatenate([np.tile(own, self.local_models), np.ones(self.schedule_size)])

    def cost(self, parameters: NetworkParameters) -> float:
        """Return the cost; infinite where the simulation is not, or the warp falls."""
        if not self.possible(parameters):
            return float("inf")
        models = self.models(parameters, False)
        return sum(run(models, one, self.observation).cost for one in self.experiments)

    def normal_equations(self, parameters: NetworkParameters, free: Free = "all") -> NormalEquations:
        """Return cost, J'r and J'J in search coordinates.

        Args:
            parameters: Where.
            free: `schedule`: only with respect to warp and kappa, the rest being zero.
        """
        models = self.models(parameters, True, free)
        rows = max(1, self.rows // _STRETCHES)
        passes = [run(models, one, self.observation, block_rows=rows) for one in self.experiments]
        gradient = np.sum([one.gradient for one in passes], axis=0)
        gram = np.sum([one.gram for one in passes], axis=0)
        sizes = self.column_sizes()
        scores = np.concatenate([one.blocks for one in passes])
        if gradient.size < sizes.size:
            ahead = sizes.size - gradient.size
            gradient, gram = np.pad(gradient, (ahead, 0)), np.pad(gram, ((ahead, 0), (ahead, 0)))
            scores = np.pad(scores, ((0, 0), (ahead, 0)))
        return NormalEquations(
            sum(one.cost for one in passes), gradient * sizes, gram * np.outer(sizes, sizes), scores * sizes
        )

    def simulate(self, parameters: NetworkParameters, experiment: Experiment) -> Array:
        """Return what the state says of `SIGNALS`, (N, 6); the rest stands in the experiment's target."""
        return run(self.models(parameters, False), experiment, self.observation, simulate=True).simulated

    def jacobian(self, parameters: NetworkParameters, experiment: Experiment) -> Array:
        """Return d `SIGNALS` / d search vector, SI units per search coordinate, (N, 6, columns).

        Every 1000 samples of a network of 4 local models with 8 parameters take 1.5 MB; `information` needs
        none of it.
        """
        found = run(self.models(parameters, True), experiment, self.observation, jacobian=True)
        return found.jacobian * self.column_sizes()

    def information(self, parameters: NetworkParameters, weight: Array) -> Array:
        """Return sum_k J(k)' diag(weight) J(k) over all experiments in search coordinates.

        Args:
            parameters: Where.
            weight: Of each of `SIGNALS`, (6,): one over its noise variance gives the Fisher information with
                the coupling over time (eq. 5.3); d theta / d search coordinate is `structure.slope`.
        """
        models = self.models(parameters, True)
        observation = Observation(self.observation.matrix, weight)
        grams = [run(models, one, observation, sensitivities=True).gram for one in self.experiments]
        sizes = self.column_sizes()
        total: Array = np.sum(grams, axis=0) * np.outer(sizes, sizes)
        return total
