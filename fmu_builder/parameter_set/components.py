"""The parts of a parameter set.

Numbers are stored as (nested) tuples of floats, so that a parameter set is immutable and prints without loss;
`nested` turns an array into such tuples. The parts check types only: what must agree between them is checked
by `ParameterSet`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


Number = Annotated[float, Field(strict=True), BeforeValidator(_plain)]
Text = Annotated[str, Field(strict=True)]
Vector = Annotated[tuple[Number, ...], BeforeValidator(_plain)]
Matrix = Annotated[tuple[Vector, ...], BeforeValidator(_plain)]
Validity = Literal["gaussian", "hat_clamped", "hat", "cubic", "cubic_warp"]
"""Kinds of validity functions; see `Partition`."""


def nested(array: NDArray[np.float64]) -> Any:
    """Return an array as nested tuples of Python floats, the form in which a parameter set holds numbers."""
    as_list = np.asarray(array, dtype=np.float64).tolist()

    def tuples(item: Any) -> Any:
        return tuple(tuples(part) for part in item) if isinstance(item, list) else item

    return tuples(as_list)


def by_name(value: Any) -> Any:
    """Return content with the keys of every dict sorted, as in the file: an FMU shows them in order."""
    if isinstance(value, dict):
        return {key: by_name(value[key]) for key in sorted(value)}
    return [by_name(one) for one in value] if isinstance(value, list) else value


Spans = Annotated[dict[str, tuple[Number, Number]], AfterValidator(by_name)]


class Part(BaseModel):
    """Base of everything in a parameter set: immutable, and unknown fields are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class _Signal(Part):
    name: Text
    unit: Text
    description: Text = ""
    operating_point: Number
    minimum: Number
    maximum: Number


class InputSignal(_Signal):
    """An input of the network.

    Attributes:
        name: FMU variable name, a C identifier.
        unit: SI unit as in a modelDescription.xml, "" or "1" for none.
        description: One line for a reader.
        operating_point: The value deviations are counted from (u_op), and the start value of the FMU.
        minimum: Smallest value seen in training.
        maximum: Largest value seen in training.
    """


class OutputSignal(_Signal):
    """An output of the network; fields as in `InputSignal`, `operating_point` is y_op."""


class Partition(Part):
    """How the operating range is divided among the local models (thesis section 3.3).

    Attributes:
        scheduling: Name of the input that schedules.
        range: Ends of the operating range; beyond them the scheduling variable is clipped for the weights.
        validity: "gaussian" (normalised Gaussians, thesis eq. 3.10-3.11), "hat" (linear interpolation between
            the centres, continued to the ends of the range), "hat_clamped" (constant beyond the outer
            centres), "cubic" (cubic interpolation between the centres) or "cubic_warp" (cubic over the warped
            variable e + v0 (e - e_mid)^2 + v1 (e - e_mid)^3, e_mid being the middle of the range). Cubic
            weights may be negative; all weights sum to 1.
        centres: One per local model, ascending, in units of the scheduling input.
        spreads: One per local model; Gaussians only.
        k_sigma: The standard deviation is k_sigma times the spread; Gaussians only.
        warp: v0 and v1, one and two over the unit of the scheduling input and its square; "cubic_warp" only.
            The warped variable rises over the whole range.
        deviation_output: Name of an output whose deviation from rest is added to the scheduling variable,
            None for no such addition.
        deviation_gain: kappa of r_n = s_n + kappa (y - y_rest) from the last tick; 0 without an output.
    """

    scheduling: Text
    range: tuple[Number, Number]
    validity: Validity
    centres: Vector
    spreads: Vector | None = None
    k_sigma: Number | None = None
    warp: tuple[Number, Number] | None = None
    deviation_output: Text | None = None
    deviation_gain: Number = 0.0


class LocalLinearModel(Part):
    """A discrete-time local linear model with n states, m inputs and p outputs.

    Attributes:
        A: State matrix [n][n].
        B: Input matrix [n][m].
        C: Output matrix [p][n].
        D: Feedthrough [p][m].
        g: (I - A)^-1 B_scheduling [n], the move of the steady state with the scheduling input; needed by the
            offsets "scheduled_equilibrium" and only by them.
        x0: Affine state vector [n] (thesis eq. 3.30); offsets "affine" only.
        u0: Affine input vector [m] (thesis eq. 3.31); offsets "affine" only.
        y0: Affine output vector [p] (thesis eq. 3.32); offsets "affine" only.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    g: Vector | None = None
    x0: Vector | None = None
    u0: Vector | None = None
    y0: Vector | None = None


class NodeTable(Part):
    """What the kernel interpolates linearly for every validity but the Gaussian.

    Attributes:
        positions: [K] ascending; the first and the last are the ends of the range.
        weights: [K][M] validity of every local model at every node; each row sums to 1.
        models: [K] the blended model at every node (blending "parameter" and "theta"); empty for "output".
    """

    positions: Vector
    weights: Matrix
    models: tuple[LocalLinearModel, ...] = ()


class StaticMap(Part):
    """Steady-state outputs over the scheduling input; linear in between, continued by the end segments.

    Attributes:
        positions: [L] ascending values of the scheduling input.
        values: [L][p] outputs.
    """

    positions: Vector
    values: Matrix


class Offsets(Part):
    """How the network knows where its outputs rest.

    Attributes:
        kind: "none" (deviations from the operating point), "affine" (thesis eq. 3.33-3.34), "low_pass"
            (scheduling input less its low-pass, look-up table behind; thesis section 3.5.4), or
            "scheduled_equilibrium" (deviations from the steady state of the present scheduling input).
        corner_frequency: Hz; low_pass only.
        static_map: low_pass and scheduled_equilibrium only.
    """

    kind: Literal["none", "affine", "low_pass", "scheduled_equilibrium"]
    corner_frequency: Number | None = None
    static_map: StaticMap | None = None


class NamedParameter(Part):
    """A number a derived output multiplies with."""

    value: Number
    unit: Text
    description: Text = ""


class DerivedTerm(Part):
    """`sign * parameter * signal`, the signal being an output or an input."""

    signal: Text
    parameter: Text
    sign: Literal[1, -1] = 1


class DerivedOutput(Part):
    """An output computed from other signals, e.g. F_p = k_E xi - k_E eta (thesis remark 2.2.1).

    An input in it acts at once, not with the next tick.
    """

    name: Text
    unit: Text
    description: Text = ""
    terms: tuple[DerivedTerm, ...]
    parameters: Annotated[dict[str, NamedParameter], AfterValidator(by_name)]


class Quantity(Part):
    """A value with its unit."""

    value: Number
    unit: Text


class SurrogateCertainty(Part):
    """How sure the physical parameters of a surrogate are.

    Attributes:
        physical_errors: Per local model, name to standard error of `physical`, in the parameter's unit; names
            without one are left out. From leaving out tenths of the operating-point data.
        tuned_errors: The same of `tuned`, from the sensitivities and residuals over the training data; none
            of a parameter at a bound, none at all beyond a condition of 1e8.
        correlations: Of `tuned`, per local model, in the order of its names; None at a bound.
        condition: Of the Fisher matrix scaled to unit diagonal; None: it is singular.
        partial: Per state and local model, name to Fisher information with the state taken as given (thesis
            eq. 5.1-5.2), per squared unit of the parameter, the state in its standard deviation.
        coupled: The same with the coupling over time (eq. 5.3).
        remarks: What cannot be told of `tuned`, in words.
        physical_remarks: What cannot be told of `physical`, in words.
    """

    physical_errors: tuple[dict[str, Number], ...]
    tuned_errors: tuple[dict[str, Number], ...]
    correlations: tuple[tuple[tuple[Number | None, ...], ...], ...] = ()
    condition: Number | None
    partial: dict[str, tuple[dict[str, Number], ...]]
    coupled: dict[str, tuple[dict[str, Number], ...]]
    remarks: tuple[Text, ...] = ()
    physical_remarks: tuple[Text, ...] = ()


class SurrogateParameters(Part):
    """The physical parameters behind the local models of a surrogate; the FMU does not compute with them.

    Attributes:
        structure: "chain7" (thesis eq. 3.22-3.35), "chain8" (torque on both lower masses), "chain9" (and a
            damper to ground) or "chain10" (collector head free, eq. 3.37).
        head: Collector head and contact parameters that were given: m_C, k_C, c_C, k_E.
        physical: Per local model, name to value: from the frequency response.
        tuned: Per local model, name to value: after output error.
        units: Name to unit.
        at_bound: Per local model, the names that ended at a bound after output error.
        physical_at_bound: The same of the physical values.
        starts: Per local model, what led to the physical values, in words.
        tuned_from: What output error started from, in words.
        recommended: Which of the two is recommended.
        reason: Why, in a sentence.
        certainty: Standard errors and what they rest on, where they were asked for.
    """

    structure: Literal["chain7", "chain8", "chain9", "chain10"]
    head: dict[str, Quantity]
    physical: tuple[dict[str, Number], ...]
    tuned: tuple[dict[str, Number], ...]
    units: dict[str, str]
    at_bound: tuple[tuple[str, ...], ...] = ()
    physical_at_bound: tuple[tuple[str, ...], ...] = ()
    starts: tuple[Text, ...] = ()
    tuned_from: Text = ""
    recommended: Literal["physical", "tuned"] = "tuned"
    reason: Text = ""
    certainty: SurrogateCertainty | None = None


class CommonExclusion(Part):
    """Why no common Lyapunov matrix exists: Z > 0 at some nodes with sum A Z A' - Z > 0.

    Attributes:
        nodes: Numbers of the nodes of the node table, from 0.
        matrices: Z, one per node, [n][n].
    """

    nodes: tuple[Annotated[int, Field(strict=True)], ...]
    matrices: tuple[Matrix, ...]


class StabilityCertificate(Part):
    """What lets anybody prove that the network is stable: a claim, which `identification.stability` proves.

    Attributes:
        model_hash: Of the model it belongs to.
        method: "nodes" (Lyapunov matrices P at nodes, linear in between, and a bound on the rate), "common"
            (one P for all nodes) or "local_models" (one P per local model; for output blending).
        rate: Largest rate of the scheduling variable, its unit per second; "nodes" only.
        decay: 1/s, the decay of the free response.
        positions: Where the matrices belong: some of the nodes, the first and the last among them, or the
            centres of the local models; empty for "common".
        matrices: P, [n][n] each, integers.
        exclusion: Why there is no common P, where that was found out.
    """

    model_hash: Text
    method: Literal["nodes", "common", "local_models"]
    rate: Number | None = None
    decay: Number
    positions: Vector = ()
    matrices: tuple[Matrix, ...]
    exclusion: CommonExclusion | None = None


class TrainedRegion(Part):
    """Where training data lie, beyond the limits that inputs and outputs carry themselves.

    Attributes:
        rate: Largest move of the scheduling input between two ticks, over the tick: its unit per second.
        derived_outputs: Name of a derived output to its smallest and largest value.
        frequency_bands: Name of an input to the lowest and highest frequency at which it was excited [Hz].
    """

    rate: Number
    derived_outputs: Spans = Field(default_factory=dict)
    frequency_bands: Spans = Field(default_factory=dict)


class ResidualBands(Part):
    """How far an output was from the reference on data held out of training, by height and frequency.

    With H ranges of the scheduling input and F bands of frequency; None where the data tell nothing. They
    belong to one model: a parameter set refuses those of another, and `ParameterSet.replaced` leaves them out
    where it changes the model.

    Attributes:
        model_hash: Of the model that was simulated.
        output: Name of an output or derived output.
        positions: [H + 1] edges of the ranges of the scheduling input, ascending.
        frequencies: [F + 1] edges of the bands [Hz], ascending.
        coverage: Share of the held-out residuals inside `bound`, between 0 and 1.
        rms: [H][F] root mean square of the residual, the output's unit.
        bound: [H][F] what `coverage` of the residuals in that band do not exceed, the output's unit.
        total: [H] the same of the residual in all bands together.
        amplitude: [H][F] amplitude of what in the model moves with the reference, over that of the reference.
        phase: [H][F] phase of the model less that of the reference [rad]; negative: the model is late.
        seconds: [H] how long the held-out data were there [s].
        held_out: Names of the experiments.
    """

    model_hash: Text
    output: Text
    positions: Vector
    frequencies: Vector
    coverage: Number
    rms: tuple[tuple[Number | None, ...], ...]
    bound: tuple[tuple[Number | None, ...], ...]
    total: tuple[Number | None, ...]
    amplitude: tuple[tuple[Number | None, ...], ...]
    phase: tuple[tuple[Number | None, ...], ...]
    seconds: Vector
    held_out: tuple[Text, ...]


@dataclass(frozen=True)
class StabilityProof:
    """What a certificate was found to prove, for whoever builds with it; `identification.stability` makes it.

    Attributes:
        model_hash: Of the model it was proved for.
        rate: Largest rate of the scheduling variable, its unit per second; None: any movement.
        move: Largest move per tick of the scheduling variable clipped to the range, None: any.
        decay: 1/s.
        statement: What is proved, with the FIT of the model, on one line.
        limits: What is not proved.
    """

    model_hash: str
    rate: float | None
    move: float | None
    decay: float
    statement: str
    limits: str
