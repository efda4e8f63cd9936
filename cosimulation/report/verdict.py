"""The verdict: what the scores say, in sentences; nothing in it that the numbers do not say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosimulation.pantograph import SIGNALS
from cosimulation.report import thesis
from cosimulation.report.modes import OperatingPointModes, modes_of_set
from cosimulation.report.views import ModelView, SetView
from cosimulation.scoring import DECIDING_SIGNAL

MINUS = "\N{MINUS SIGN}"
SPACE = "\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class Verdict:
    """What is to be said about one white-box set.

    Attributes:
        name: The white-box set.
        best: The model that is best on validation data.
        fit: Its FIT of the contact force on test data [%].
        above_thesis: Whether that is above the thesis's best.
        sentences: What it reaches, how fast it is, what is not good: a lead and a text each.
    """

    name: str
    best: ModelView
    fit: float
    above_thesis: bool
    sentences: tuple[tuple[str, str], ...]


def percent(value: float, digits: int = 1) -> str:
    """Return a percentage as text, with a typographic minus."""
    return f"{value:.{digits}f}{SPACE}%".replace("-", MINUS) if np.isfinite(value) else "not finite"


def times(factor: float) -> str:
    """Return a factor as text: two digits below 100, grouped above."""
    return f"{factor:.2g}" if factor < 100.0 else f"{round(factor, 2 - len(str(int(factor)))):,.0f}"


def verdict(view: SetView) -> Verdict:
    """Return the verdict on one white-box set."""
    best = view.best
    fit = best.fit(DECIDING_SIGNAL)
    sentences = (("", _reached(view)), ("", _speed(best)), _not_good(view))
    above = fit > thesis.BEST_CONTACT_FORCE
    return Verdict(view.name, best, fit, above, tuple(item for item in sentences if item[1]))


def _reached(view: SetView) -> str:
    best = view.best
    fit = best.fit(DECIDING_SIGNAL)
    scored = view.reference(DECIDING_SIGNAL)[view.scored]
    difference = fit - thesis.BEST_CONTACT_FORCE
    side = "above" if difference > 0.0 else "below"
    weakest = min(SIGNALS, key=best.fit)
    title, largest = best.title, best.max_error(DECIDING_SIGNAL)
    text = (
        f"The best model, {title}, reaches a FIT of {percent(fit)} for the contact force on unseen data, "
        f"{abs(difference):.1f} percentage points {side} the thesis's best "
        f"({percent(thesis.BEST_CONTACT_FORCE)}). Its largest error is {largest:.3g}{SPACE}N where the force "
        f"runs from {scored.min():.0f} to {scored.max():.0f}{SPACE}N; its weakest signal is {weakest}, "
        f"{best.meaning(weakest)}, with {percent(best.fit(weakest))}."
    )
    return text.replace(" -", f" {MINUS}")


def _speed(best: ModelView) -> str:
    if best.step_time is None:
        return ""
    own, factor = best.step_time["own_ns"], best.step_time["speed_up"]
    real_time = 1.0 / best.step_time["real_time_factor"]
    against = f"{times(factor)} times faster" if factor > 1.0 else f"{times(1.0 / factor)} times slower"
    return (
        f"Its FMU spends {own:.0f}{SPACE}ns of its own code per tick of 1{SPACE}ms: {times(real_time)} times "
        f"faster than real time, {against} than the white-box FMU."
    )


def _not_good(view: SetView) -> tuple[str, str]:
    points = modes_of_set(view)
    parts = [_surrogate(model, view.best, points) for model in view.surrogates if model is not view.best]
    behind = [
        model
        for model in view.models
        if model not in view.surrogates and model.fit(DECIDING_SIGNAL) <= thesis.BEST_CONTACT_FORCE
    ]
    if behind:
        listed = ", ".join(f"{model.title} ({percent(model.fit(DECIDING_SIGNAL))})" for model in behind)
        parts.append(f"not above the thesis's best: {listed}")
    if not parts:
        return "", "Every model compared here is above the thesis's best."
    return "Not good:", f"{'; '.join(parts)}."


def _surrogate(model: ModelView, best: ModelView, points: Sequence[OperatingPointModes]) -> str:
    """Say how far a surrogate is behind, and what of its structure the figures show."""
    gap = best.fit(DECIDING_SIGNAL) - model.fit(DECIDING_SIGNAL)
    text = f"the surrogate reaches {percent(model.fit(DECIDING_SIGNAL))}, {abs(gap):.1f} points "
    text += "behind the best model" if gap >= 0.0 else "more than the best model on validation data"
    facts = []
    result = model.candidate.surrogate
    if result is not None:
        held = sum(len(row) for row in result.at_bound(result.recommended))
        if held:
            total = result.theta(result.recommended).size
            facts.append(f"{held} of its {total} parameters stand at a bound")
        if result.tuning is not None and not result.tuning.converged:
            facts.append("its tuning stopped at the iteration limit")
    lost = sum(None in point.models.get(model.title, ()) for point in points)
    if lost:
        facts.append(f"{lost} of its {len(points)} local models miss a mode of the reference")
    return f"{text} ({', '.join(facts)})" if facts else text
