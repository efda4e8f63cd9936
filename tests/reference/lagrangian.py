"""An independent reading of the white-box model: Lagrange's equations from the energies, by sympy.

Shares nothing with the C code: the kinematics use acos and atan2, velocities come from differentiating
positions, the mass matrix and the forces from the energies. Generated functions take any number
type of their backend.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import sympy as sp

PARAMETERS = sp.symbols(
    "l1 l2 b c dx dy alpha yA m1 s1 J1 m2 s2 J2 m3 mB mK mC k_C c_C k_d c_d k_E g crossbar_drift_reference"
    " unilateral friction_base friction_knee friction_rod_end friction_rod_foot friction_bend"
    " friction_slip_rate friction_stribeck_ratio friction_stribeck_rate",
    real=True,
)
STATE = sp.symbols("phi w delta d xi v", real=True)
INPUT = sp.symbols("eta torque", real=True)
P = {symbol.name: symbol for symbol in PARAMETERS}
phi, w, delta, d, xi, v = STATE
eta, torque = INPUT
q = sp.Matrix([phi, delta, xi])
qd = sp.Matrix([w, d, v])


def direction(angle: sp.Expr) -> sp.Matrix:
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


def velocity(position: sp.Matrix) -> sp.Matrix:
    return position.jacobian(q) * qd


def square(vector: sp.Matrix) -> sp.Expr:
    return (vector.T * vector)[0]


def compression() -> sp.Expr:
    """How far the wire is pressed up; below zero only where the contact pulls as well."""
    gap = xi - eta
    return sp.Piecewise((gap, sp.Or(gap > 0, P["unilateral"] < 1)), (0, True))


def joint_torque(coulomb: sp.Expr, rate: sp.Expr) -> sp.Expr:
    """Dry friction against a joint's rate, Coulomb's after Stribeck's."""
    breakaway = coulomb * P["friction_stribeck_ratio"]
    fall = sp.exp(-((rate / P["friction_stribeck_rate"]) ** 2))
    return (coulomb + (breakaway - coulomb) * fall) * sp.tanh(rate / P["friction_slip_rate"])


@functools.cache
def mechanism() -> dict[str, Any]:
    """Energies and positions; lever angle theta and rod angle rho are functions yet to be put in."""
    theta, rho = sp.Function("theta")(phi), sp.Function("rho")(phi)
    psi = theta + sp.pi - P["alpha"] + delta
    knee = P["l1"] * direction(phi)
    crossbar = knee + P["l2"] * direction(psi)
    upper = knee + P["s2"] * direction(psi)
    lower = P["s1"] * direction(phi)
    rod_middle = sp.Matrix([P["dx"], P["dy"]]) + P["c"] / 2 * direction(rho)
    zeta = P["yA"] + crossbar[1]
    rates = {angle: (velocity(sp.Matrix([angle])))[0] for angle in (psi, rho)}
    kinetic = sp.Rational(1, 2) * (
        P["m1"] * square(velocity(lower))
        + P["J1"] * w**2
        + P["mB"] * square(velocity(knee))
        + P["m2"] * square(velocity(upper))
        + P["J2"] * rates[psi] ** 2
        + P["mK"] * square(velocity(crossbar))
        + P["m3"] * square(velocity(rod_middle))
        + P["m3"] * P["c"] ** 2 / 12 * rates[rho] ** 2
        + P["mC"] * v**2
    )
    heights = ((P["m1"], lower[1]), (P["mB"], knee[1]), (P["m2"], upper[1]), (P["mK"], crossbar[1]))
    weight = sum(mass * height for mass, height in (*heights, (P["mC"], xi)))
    weight += P["m3"] * P["c"] / 2 * sp.sin(rho)  # the middle of the rod, from its fixed end
    springs = P["k_d"] * delta**2 + P["k_C"] * (zeta - xi) ** 2 + P["k_E"] * compression() ** 2
    potential = P["g"] * weight + springs / 2
    return {
        "theta": theta,
        "rho": rho,
        "kinetic": kinetic,
        "potential": potential,
        "zeta": zeta,
        "zeta_dot": velocity(sp.Matrix([zeta]))[0],
        "drift": crossbar[0] - P["crossbar_drift_reference"],
        "joints": {"base": phi, "knee": theta - phi, "rod_end": rho - theta, "rod_foot": rho, "bend": delta},
    }


@functools.cache
def closure() -> tuple[sp.Expr, sp.Expr]:
    """theta and rho as explicit functions of phi: triangle of knee, rod end and frame pivot."""
    to_knee = P["l1"] * direction(phi) - sp.Matrix([P["dx"], P["dy"]])
    distance = sp.sqrt(square(to_knee))
    gamma = sp.acos((distance**2 + P["b"] ** 2 - P["c"] ** 2) / (2 * distance * P["b"]))
    theta = sp.atan2(-to_knee[1], -to_knee[0]) + gamma
    rod = to_knee + P["b"] * direction(theta)
    return theta, sp.atan2(rod[1], rod[0])


def _explicit(expressions: list[sp.Expr]) -> list[sp.Expr]:
    """Put the closure and its derivatives in, as numbered symbols that cse resolves."""
    parts = mechanism()
    theta, rho = closure()
    replacements: dict[sp.Expr, sp.Expr] = {}
    for function, explicit in ((parts["theta"], theta), (parts["rho"], rho)):
        for order in (2, 1):
            replacements[sp.diff(function, phi, order)] = sp.diff(explicit, phi, order)
        replacements[function] = explicit
    return [expression.subs(list(replacements.items())) for expression in expressions]


@functools.cache
def motion() -> list[sp.Expr]:
    """Entries of M (row by row) and of the right-hand side in M qdd = Q."""
    parts = mechanism()
    kinetic, potential = parts["kinetic"], parts["potential"]
    momentum = sp.Matrix([sp.diff(kinetic, rate) for rate in qd])
    mass = momentum.jacobian(qd)
    head = P["c_C"] * (parts["zeta_dot"] - v)
    relative = sp.Matrix([parts["zeta_dot"] - v]).jacobian(qd).T
    generalised = sp.Matrix([torque, -P["c_d"] * d, 0]) - relative * head
    for name, angle in parts["joints"].items():
        turned = sp.Matrix([angle])
        brake = joint_torque(P[f"friction_{name}"], velocity(turned)[0])
        generalised -= turned.jacobian(q).T * brake
    conservative = sp.Matrix([sp.diff(kinetic - potential, coordinate) for coordinate in q])
    right = generalised + conservative - momentum.jacobian(q) * qd
    return [*mass, *right]


def _compiled(expressions: list[sp.Expr], modules: str) -> Callable[..., list[Any]]:
    arguments = (STATE, INPUT, PARAMETERS)
    function: Callable[..., list[Any]] = sp.lambdify(arguments, _explicit(expressions), modules, cse=True)
    return function


@functools.cache
def equations(modules: str = "math") -> Callable[..., list[Any]]:
    """(state, input, parameters) -> 9 entries of M and 3 of the right-hand side."""
    return _compiled(motion(), modules)


@functools.cache
def outputs(modules: str = "math") -> Callable[..., list[Any]]:
    """(state, input, parameters) -> the eleven outputs."""
    parts = mechanism()
    zeta, zeta_dot = parts["zeta"], parts["zeta_dot"]
    crossbar_force = P["k_C"] * (zeta - xi) + P["c_C"] * (zeta_dot - v)
    contact_force = P["k_E"] * compression()
    rest = [crossbar_force, contact_force, phi, w, delta, d, parts["drift"]]
    return _compiled([xi, v, zeta, zeta_dot, *rest], modules)


@functools.cache
def energy() -> Callable[..., list[Any]]:
    """(state, input, parameters) -> kinetic plus potential energy, the drive's M phi1 taken off."""
    parts = mechanism()
    return _compiled([parts["kinetic"] + parts["potential"] - torque * phi], "math")


def accelerations(state: Any, inputs: Any, parameters: Any, modules: str = "math") -> list[Any]:
    """The three accelerations, by elimination in the number type that comes in."""
    entries = equations(modules)(state, inputs, parameters)
    m11, m12, _, _, m22, _, _, _, m33 = entries[:9]
    q1, q2, q3 = entries[9:]
    determinant = m11 * m22 - m12 * m12
    return [(q1 * m22 - q2 * m12) / determinant, (q2 * m11 - q1 * m12) / determinant, q3 / m33]
