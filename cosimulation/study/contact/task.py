"""What the study runs: friction, lift-off, both, jumps of the wire, and a slow ramp."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosimulation.pantograph import SIGNALS, TORQUE
from cosimulation.study.contact.settings import ContactSettings
from cosimulation.study.contact.situation import (
    F_P,
    Situation,
    below_zero,
    compared,
    excitation,
    force_findings,
    timing,
)
from cosimulation.study.side_by_side import SAMPLE_TIME, WHITE_BOX, Record, SideBySide, measured, side_by_side
from identification.arrays import Array
from identification.contact_statistics import contact_losses, first_loss, hysteresis_width

TWIN = "white-box twin"
"""The white-box model again, on a wire that is a hair higher: how far the motion can be predicted at all."""
_CURVE_ROWS = 1200
_SHOWN_BEFORE, _SHOWN_AFTER = 0.15, 0.45
_LATEST_SHOWN = 0.5
_REST_ROWS = 50


@dataclass(frozen=True)
class ContactTask:
    """All runs of one white-box set with one draw.

    Attributes:
        white_box: The white-box FMU.
        wbm: The white-box set.
        seed: Of the draw.
        settings: The study's.
    """

    white_box: Path
    wbm: str
    seed: int
    settings: ContactSettings

    @property
    def first(self) -> bool:
        """Whether it also makes what no draw has part in, and the curves that are shown."""
        return self.seed == self.settings.seeds[0]


def tasks(settings: ContactSettings, white_box: Path) -> list[ContactTask]:
    """Return the independent tasks of the study."""
    return [ContactTask(white_box, wbm, seed, settings) for wbm in settings.sets for seed in settings.seeds]


def run_task(task: ContactTask) -> list[Record]:
    """Return scores, findings and curves."""
    with side_by_side(task.wbm, task.white_box) as pair:
        found = [record for one in _situations(task.settings) for record in _run(task, pair, one)]
        if task.first:
            found += _ramp(task, pair)
            for rise in (task.settings.jump, -task.settings.jump):
                found += _jump(task, pair, rise)
    return found


def _situations(settings: ContactSettings) -> Iterator[Situation]:
    for case in settings.frictions:
        for amplitude in settings.friction_amplitudes:
            yield Situation("friction", case.name, case.coulomb, amplitude)
    none = settings.frictions[0].name
    for torque in settings.torques:
        for amplitude in settings.amplitudes:
            yield Situation("lift-off", none, 0.0, amplitude, torque, unilateral=True)
    for one in settings.combinations:
        case = settings.friction(one.friction)
        yield Situation("both", case.name, case.coulomb, one.amplitude, one.torque, unilateral=True)


def _run(task: ContactTask, pair: SideBySide, situation: Situation) -> Iterator[Record]:
    """Yield what the networks get right in one situation, and with lift-off what the twin gets right."""
    inputs = excitation(situation, task.seed, task.settings.duration)
    friction = task.settings.friction(situation.friction).options
    options = {"unilateral": situation.unilateral, **friction}
    reference = pair.reference(inputs, options)
    contacts = ("unilateral", "bilateral") if situation.unilateral else ("bilateral",)
    shown = {}
    for network in pair.networks:
        for contact in contacts:
            run = pair.network(network, inputs, {"unilateral": contact == "unilateral"})
            shown[network, contact] = run.force
            labels = situation.labels(task.wbm, network, task.seed, contact)
            yield from compared(reference, run.outputs, labels)
            outside = 100.0 * float(np.mean(~run.in_range))
            yield {**measured("time out of range", outside, "%", labels), "reference": None}
    if situation.unilateral:
        labels = situation.labels(task.wbm, WHITE_BOX, task.seed, "unilateral")
        yield below_zero(reference[:, F_P], labels)
        higher = inputs + np.array([task.settings.twin_rise, 0.0])
        twin = pair.reference(higher, options)
        labels = situation.labels(task.wbm, TWIN, task.seed, "unilateral")
        yield from compared(reference, twin, labels)
        if task.first and _is_shown(task.settings, situation):
            yield from _close_up(task, situation, reference[:, F_P], shown)


def _is_shown(settings: ContactSettings, situation: Situation) -> bool:
    shown = situation.part, situation.amplitude, situation.torque
    return shown == ("lift-off", settings.shown_amplitude, TORQUE)


def _close_up(
    task: ContactTask, situation: Situation, reference: Array, runs: dict[tuple[str, str], Array]
) -> Iterator[Record]:
    """Yield the contact force around the longest lost contact of the first half."""
    losses = [
        loss
        for loss in contact_losses(reference, SAMPLE_TIME)
        if loss.begin < _LATEST_SHOWN * len(reference) * SAMPLE_TIME
    ]
    if not losses:
        return
    middle = max(losses, key=lambda loss: loss.duration).begin
    begin = max(0, round((middle - _SHOWN_BEFORE) / SAMPLE_TIME))
    rows = slice(begin, begin + round((_SHOWN_BEFORE + _SHOWN_AFTER) / SAMPLE_TIME))
    curves = [(WHITE_BOX, "unilateral", reference), *((*key, force) for key, force in runs.items())]
    for network, contact, force in curves:
        yield {
            "drawing": "close-up",
            "wbm": task.wbm,
            "network": network,
            "contact": contact,
            "begin": begin * SAMPLE_TIME,
            "amplitude": situation.amplitude,
            "force": force[rows].tolist(),
        }


def _jump(task: ContactTask, pair: SideBySide, rise: float) -> Iterator[Record]:
    """Yield what happens when the wire jumps by `rise` [m] after some rest."""
    settings = task.settings
    rest = _REST_ROWS
    height = np.full(rest + round(settings.jump_duration / SAMPLE_TIME), settings.jump_height)
    height[rest:] += rise
    inputs = np.column_stack([height, np.full(len(height), TORQUE)])
    none = settings.frictions[0].name
    name = f"wire {'raised' if rise > 0.0 else 'dropped'} by {1e3 * abs(rise):g} mm"
    situation = Situation("jump", none, amplitude=rise, unilateral=True)
    reference = pair.reference(inputs, {"unilateral": True})
    forces = {(WHITE_BOX, "unilateral"): reference[:, F_P]}
    for network in pair.networks:
        for contact in ("unilateral", "bilateral"):
            run = pair.network(network, inputs, {"unilateral": contact == "unilateral"})
            forces[network, contact] = run.force
            labels = situation.labels(task.wbm, network, task.seed, contact)
            after = reference[rest:, F_P], run.force[rest:]
            yield from force_findings(*after, labels)
            yield from timing(*after, labels)
    for (network, contact), force in forces.items():
        loss = first_loss(contact_losses(force, SAMPLE_TIME), SAMPLE_TIME)
        labels = situation.labels(task.wbm, network, task.seed, contact)
        duration = loss.duration if loss else 0.0
        yield {**measured("first loss after a jump", duration, "s", labels), "reference": None}
        peak = float(force[rest:].max())
        yield {**measured("largest F_p after a jump", peak, "N", labels), "reference": None}
        yield {
            "drawing": "jump",
            "wbm": task.wbm,
            "network": network,
            "contact": contact,
            "begin": -rest * SAMPLE_TIME,
            "title": name,
            "force": force.tolist(),
        }


def _ramp(task: ContactTask, pair: SideBySide) -> Iterator[Record]:
    """Yield hysteresis over a slow ramp, less what held inputs add, beside 2 T_c / z_1."""
    settings = task.settings
    rise = np.arange(*settings.ramp, settings.ramp_speed * SAMPLE_TIME)
    height = np.concatenate([rise, rise[::-1]])
    inputs = np.column_stack([height, np.full(len(height), TORQUE)])
    low, high = settings.ramp_counted
    wanted = (*SIGNALS, "phi_1")
    lift = 0.0
    for case in settings.frictions:
        rows = pair.reference(inputs, case.options, wanted)
        lift = lift or _lift(rows, height, low, high)
        bias = _bias(task, pair) * settings.ramp_speed * SAMPLE_TIME
        width = hysteresis_width(height, rows[:, F_P], low, high) - bias
        labels = Situation("ramp", case.name, case.coulomb).labels(
            task.wbm, WHITE_BOX, task.seed, "bilateral"
        )
        theory = 2.0 * case.coulomb / lift
        yield {**measured("width of the hysteresis", width, "N", labels), "reference": theory}
        if case.axis and case.coulomb > 0.0:
            away = 100.0 * abs(width / theory - 1.0)
            yield {**measured("hysteresis away from 2 T_c / z_1", away, "%", labels), "reference": None}
        yield _loop(task.wbm, WHITE_BOX, case.name, height, rows[:, F_P], bias)
    for network in pair.networks:
        run = pair.network(network, inputs)
        width = hysteresis_width(height, run.force, low, high) - bias
        labels = Situation("ramp", settings.frictions[0].name).labels(
            task.wbm, network, task.seed, "bilateral"
        )
        yield {**measured("width of the hysteresis", width, "N", labels), "reference": 0.0}
        yield _loop(task.wbm, network, settings.frictions[0].name, height, run.force, bias)


def _bias(task: ContactTask, pair: SideBySide) -> float:
    """Return the contact stiffness [N/m], by which held inputs bias the force of a moving wire."""
    inputs = np.full((1, 2), (task.settings.jump_height, TORQUE))
    xi, force = pair.reference(inputs, outputs=("xi", "F_p"))[0]
    return float(force / (xi - task.settings.jump_height))


def _lift(rows: Array, height: Array, low: float, high: float) -> float:
    """Return z_1 = d zeta / d phi_1 [m/rad] averaged between two heights, from a ramp without friction."""
    half = slice(0, len(height) // 2)
    ends = np.searchsorted(height[half], (low, high))
    zeta, angle = (rows[half, column][ends] for column in (SIGNALS.index("zeta"), len(SIGNALS)))
    return float((zeta[1] - zeta[0]) / (angle[1] - angle[0]))


def _loop(wbm: str, network: str, friction: str, height: Array, force: Array, bias: float) -> Record:
    """Return the contact force over the height, averaged over short stretches, held inputs' bias removed."""
    stretch = max(1, len(height) // _CURVE_ROWS)
    rows = len(height) // stretch * stretch
    falling = np.arange(len(height)) >= len(height) // 2
    corrected = force + np.where(falling, -0.5 * bias, 0.5 * bias)
    mean = [one[:rows].reshape(-1, stretch).mean(axis=1) for one in (height, corrected)]
    return {
        "drawing": "loop",
        "wbm": wbm,
        "network": network,
        "friction": friction,
        "height": mean[0].tolist(),
        "force": mean[1].tolist(),
    }
