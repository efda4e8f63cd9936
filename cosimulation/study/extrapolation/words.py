"""What the study found, in sentences made of its figures."""

from __future__ import annotations

import numpy as np

from cosimulation.report.tables import number
from cosimulation.study.extrapolation.inputs import UNITS, trained_region
from cosimulation.study.extrapolation.results import Results
from cosimulation.study.extrapolation.settings import Cause
from cosimulation.study.extrapolation.task import CLAMP, QUANTILE_MEASURE, WARN

MOSTLY = 50.0
"""A record that is out of range for this share of the time counts as told [%]."""


def usable(results: Results, wbm: str, cause: Cause) -> tuple[float, float] | None:
    """Return the ends of the values around `inside` where all networks and draws are usable, or None."""
    values = list(cause.values)
    start = values.index(cause.inside)

    def good(index: int) -> bool:
        return results.worst_fit(wbm, cause, values[index]) >= results.settings.usable_fit

    if not good(start):
        return None
    low, high = start, start
    while low > 0 and good(low - 1):
        low -= 1
    while high < len(values) - 1 and good(high + 1):
        high += 1
    return values[low], values[high]


def span(results: Results, wbm: str, cause: Cause) -> str:
    """Say where the networks are usable."""
    unit = _unit(cause)
    found = usable(results, wbm, cause)
    if found is None:
        return f"Not usable even at {cause.inside:g}{unit}."
    known = trained_region(results.networks(wbm)[0], cause)
    trained = f", trained {known[0]:.4g} to {known[1]:.4g}{unit}" if known else ""
    parts = [f"Usable from {found[0]:g} to {found[1]:g}{unit}{trained}."]
    outer = [at for at in cause.values if not found[0] <= at <= found[1]]
    fits = {at: results.worst_fit(wbm, cause, at) for at in outer}
    bad = [f"{at:g}{unit}: {number(fit, 0)} %" for at, fit in fits.items() if np.isfinite(fit)]
    if bad:
        parts.append(f"Beyond, FIT at {', '.join(bad)}.")
    silent = [f"{at:g}{unit}" for at, fit in fits.items() if np.isnan(fit)]
    if silent:
        parts.append(f"The white-box model itself gave out at {', '.join(silent)}.")
    return " ".join(parts)


def growth(results: Results, wbm: str, cause: Cause) -> str:
    """Say how the error grows towards the ends."""
    parts = []
    for at in _ends(cause):
        names = results.networks(wbm)
        errors = [results.value(QUANTILE_MEASURE, wbm, name, cause, at) for name in names]
        inside = [results.value(QUANTILE_MEASURE, wbm, name, cause, cause.inside) for name in names]
        if np.isfinite(errors).all():
            worst = int(np.argmax(errors))
            parts.append(
                f"{errors[worst]:.3g} N at {at:g}{_unit(cause)} ({inside[worst]:.2g} N at {cause.inside:g})"
            )
    return (
        "95 % of the errors of F_p below " + ", ".join(parts) + "."
        if parts
        else "No error is known at the ends."
    )


def told(results: Results, wbm: str, cause: Cause) -> str:
    """Say whether in_range tells of the values outside the trained region."""
    name = results.networks(wbm)[0]
    known = trained_region(name, cause)
    if known is None:
        return "Nobody knows where the training ended."
    outer = [at for at in cause.values if not known[0] <= at <= known[1]]
    if not outer:
        return "No value outside was tried."
    shares = {at: results.value("time out of range", wbm, name, cause, at) for at in outer}
    quiet = [f"{at:g}{_unit(cause)} ({share:.2g} %)" for at, share in shares.items() if not share >= MOSTLY]
    if not quiet:
        return "in_range is false for most of the time at every value outside."
    if len(quiet) == len(outer):
        most = max(shares.values())
        return f"in_range says next to nothing: it is false for at most {most:.2g} % of the time."
    return f"in_range is false for most of the time, except at {', '.join(quiet)} of the time."


def clamped(results: Results, wbm: str, cause: Cause) -> str:
    """Say what the policy clamp does to the error."""
    if CLAMP not in results.policies:
        return "These FMUs have no choice of a policy."
    parts = []
    for at in _ends(cause):
        fits = [results.worst_fit(wbm, cause, at, policy) for policy in (WARN, CLAMP)]
        if np.isfinite(fits).all():
            parts.append(
                f"{at:g}{_unit(cause)}: FIT {number(fits[1], 0)} % in place of {number(fits[0], 0)} %"
            )
    return "; ".join(parts) + "." if parts else "Nothing to compare with at the ends."


def _ends(cause: Cause) -> tuple[float, ...]:
    """Return the outermost values, without the one inside."""
    return tuple(at for at in (cause.values[0], cause.values[-1]) if at != cause.inside)


def _unit(cause: Cause) -> str:
    unit = UNITS[cause.name]
    return "" if unit == "1" else f" {unit}"
