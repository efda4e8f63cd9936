"""What the study found, in sentences made of its figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cosimulation.pantograph import TORQUE
from cosimulation.report.tables import number
from cosimulation.study.contact.results import Results
from cosimulation.study.contact.situation import Situation
from cosimulation.study.contact.task import TWIN
from cosimulation.study.side_by_side import WHITE_BOX, model_of

Answer = Callable[[Results, str], str]


def _usable_up_to(results: Results, wbm: str, ordered: Sequence[Situation], contact: str) -> Situation | None:
    """Return the last of the situations, in rising order, up to which every network and draw is usable."""
    last = None
    for one in ordered:
        if not results.worst_fit(wbm, one, contact) >= results.settings.usable_fit:
            break
        last = one
    return last


def _axis(results: Results, amplitude: float) -> list[Situation]:
    wanted = {case.name for case in results.settings.frictions if case.axis}
    chosen = [one for one in results.frictions(amplitude) if one.friction in wanted]
    return sorted(chosen, key=lambda one: one.coulomb)


def friction(results: Results, wbm: str) -> str:
    """Say up to which friction the contact force is usable."""
    parts = []
    for amplitude in results.settings.friction_amplitudes:
        levels = _axis(results, amplitude)
        last = _usable_up_to(results, wbm, levels, "bilateral")
        most = levels[-1]
        fit = results.worst_fit(wbm, most, "bilateral")
        usable = f"usable up to {last.coulomb:g} N.m" if last else "not usable even without friction"
        parts.append(f"amplitude {amplitude:g}: {usable}; FIT {number(fit, 0)} % at {most.coulomb:g} N.m")
    return "; ".join(parts) + "."


def other_signals(results: Results, wbm: str) -> str:
    """Say which signals suffer most from friction."""
    levels = _axis(results, results.settings.friction_amplitudes[0])
    last = levels[-1]
    fits = {
        signal: results.worst_fit(wbm, last, "bilateral", signal)
        for signal in ("xi", "xi_dot", "zeta", "zeta_dot", "F_H")
    }
    said = ", ".join(f"{signal} {number(fit, 0)} %" for signal, fit in fits.items())
    bad = [signal for signal, fit in fits.items() if not fit >= results.settings.usable_fit]
    verdict = f"Not usable: {', '.join(bad)}." if bad else "All of them are usable."
    return f"At {last.coulomb:g} N.m, full amplitude: {said}. {verdict}"


def mean_force(results: Results, wbm: str) -> str:
    """Say whether the mean force is right in spite of friction."""
    values = [
        (results.largest("error of mean F_p", wbm, one, "bilateral"), one, amplitude)
        for amplitude in results.settings.friction_amplitudes
        for one in results.frictions(amplitude)
    ]
    error, one, amplitude = max(values, key=lambda item: item[0])
    name = results.networks(wbm)[0]
    mean = results.value("mean F_p", wbm, name, one, "bilateral", "reference")
    return f"At most {error:.1f} N off, of {mean:.1f} N ({one.friction}, amplitude {amplitude:g})."


def hysteresis(results: Results, wbm: str) -> str:
    """Say how wide the loop of the white-box model is, and that of the networks."""
    names = [case for case in results.settings.frictions if case.axis and case.coulomb > 0.0]
    none = Situation("ramp", results.settings.frictions[0].name)
    widths = [
        abs(results.value("width of the hysteresis", wbm, name, none, "bilateral"))
        for name in results.networks(wbm)
    ]
    said = (
        f"The networks run on one line (at most {max(widths):.2f} N between up and down): they have no "
        "hysteresis."
    )
    if not names:
        return said
    case = names[-1]
    dry = Situation("ramp", case.name, case.coulomb)
    width = results.value("width of the hysteresis", wbm, WHITE_BOX, dry, "bilateral")
    theory = results.value("width of the hysteresis", wbm, WHITE_BOX, dry, "bilateral", "reference")
    return f"White-box model at {case.coulomb:g} N.m: {width:.1f} N (2 T_c / z_1 = {theory:.1f} N). {said}"


def single_bounces(results: Results, wbm: str) -> str:
    """Say up to which amplitude the contact force is right at every instant."""
    ordered = sorted(results.lift_offs(), key=lambda one: one.amplitude)
    last = _usable_up_to(results, wbm, ordered, "unilateral")
    first = results.networks(wbm)[0]
    if last is None:
        return "Not usable at any amplitude that was tried."
    share = results.value("time without contact", wbm, first, last, "unilateral", "reference")
    said = f"Usable up to amplitude {last.amplitude:g}, with {share:.1f} % of the time without contact."
    beyond = [one for one in ordered if one.amplitude > last.amplitude]
    if beyond:
        parts = [
            f"{one.amplitude:g}: {number(results.worst_fit(wbm, one, 'unilateral'), 0)} % (twin "
            f"{number(results.fit(wbm, TWIN, one, 'unilateral'), 0)} %)"
            for one in beyond
        ]
        said += f" Not usable beyond, FIT at amplitude {', '.join(parts)}."
    return said


def statistics(results: Results, wbm: str) -> str:
    """Say whether the statistics hold where the single bounce does not."""
    settings = results.settings
    good, everything = 0, [one for torque in settings.torques for one in results.lift_offs(torque)]
    worst = (0.0, 0.0)
    for one in everything:
        loss = results.largest("error of the time without contact", wbm, one, "unilateral")
        spread = results.largest("error of the standard deviation of F_p", wbm, one, "unilateral")
        good += loss <= settings.usable_loss and spread <= settings.usable_deviation
        worst = max(worst[0], loss), max(worst[1], spread)
    peak = max(
        _relative_peak(results, wbm, name, one) for one in everything for name in results.networks(wbm)
    )
    return (
        f"{good} of {len(everything)} situations within {settings.usable_loss:g} percentage points of the "
        f"time without contact and {settings.usable_deviation:g} % of the standard deviation; at worst "
        f"{worst[0]:.1f} points, {worst[1]:.1f} %, and the largest force {peak:.0f} % off."
    )


def _relative_peak(results: Results, wbm: str, name: str, one: Situation) -> float:
    """Return how far the median of the largest force is off [%]."""
    ours, theirs = (
        results.value("largest F_p", wbm, name, one, "unilateral", field) for field in ("value", "reference")
    )
    return 100.0 * abs(ours / theirs - 1.0)


def ignored(results: Results, wbm: str) -> str:
    """Say what somebody gets who leaves unilateral off."""
    ordered = sorted(results.lift_offs(), key=lambda one: one.amplitude)
    last = _usable_up_to(results, wbm, ordered, "bilateral")
    usable = f"Usable up to amplitude {last.amplitude:g}" if last else "Not usable at any amplitude tried"
    most = ordered[-1]
    name = results.networks(wbm)[0]
    deviation = [
        results.value("standard deviation of F_p", wbm, name, most, "bilateral", field)
        for field in ("value", "reference")
    ]
    share = [
        results.value("time without contact", wbm, name, most, "bilateral", field)
        for field in ("value", "reference")
    ]
    return (
        f"{usable}. At amplitude {most.amplitude:g} its force is negative for {share[0]:.0f} % of the time "
        f"where contact is lost for {share[1]:.0f} %, and its standard deviation is {deviation[0]:.0f} N in "
        f"place of {deviation[1]:.0f} N."
    )


def torque(results: Results, wbm: str) -> str:
    """Say what a larger static force does to the networks."""
    parts = []
    for mean in results.settings.torques:
        if mean == TORQUE:
            continue
        calm = min(results.lift_offs(mean), key=lambda one: one.amplitude)
        ordered = sorted(results.lift_offs(mean), key=lambda one: one.amplitude)
        usable = [
            one for one in ordered if results.worst_fit(wbm, one, "unilateral") >= results.settings.usable_fit
        ]
        error = results.value("error of mean F_p", wbm, results.networks(wbm)[0], calm, "unilateral")
        upto = (
            f"usable at amplitudes {usable[0].amplitude:g} to {usable[-1].amplitude:g}"
            if usable
            else "not usable"
        )
        outside = results.value("time out of range", wbm, results.networks(wbm)[0], calm, "unilateral")
        parts.append(
            f"{mean:g} N.m: {upto}, mean force {error:.1f} N off, in_range false for {outside:.0f} %"
        )
    return "; ".join(parts) + "." if parts else "Not tried."


def raised(results: Results, wbm: str) -> str:
    """Say when contact is lost and regained after the wire was raised."""
    one = results.jumps()[0]
    name = results.networks(wbm)[0]
    begin = 1e3 * results.value("first lift-off", wbm, name, one, "unilateral", "reference")
    if begin != begin:
        return "The white-box model keeps contact, or loses it for less than 5 ms."
    reference = 1e3 * results.value("first loss after a jump", wbm, WHITE_BOX, one, "unilateral")
    found = ", ".join(
        f"{model_of(name)} "
        f"{1e3 * results.value('first loss after a jump', wbm, name, one, 'unilateral'):.0f} ms"
        for name in results.networks(wbm)
    )
    pull = results.value("smallest F_p", wbm, name, one, "bilateral")
    when = "at once" if begin == 0.0 else f"after {begin:.0f} ms"
    return (
        f"Contact lost {when}, regained after {reference:.0f} ms; {found}. With unilateral off the network "
        f"pulls with {-pull:.0f} N instead."
    )


def dropped(results: Results, wbm: str) -> str:
    """Say what happens after the wire was dropped."""
    one = results.jumps()[1]
    name = results.networks(wbm)[0]
    peak = [
        results.value("largest F_p", wbm, name, one, "unilateral", field) for field in ("value", "reference")
    ]
    reference = 1e3 * results.value("first loss after a jump", wbm, WHITE_BOX, one, "unilateral")
    found = ", ".join(
        f"{model_of(item)} "
        f"{1e3 * results.value('first loss after a jump', wbm, item, one, 'unilateral'):.0f} ms"
        for item in results.networks(wbm)
    )
    pressed = f"Pressed with {peak[1]:.0f} N (network {peak[0]:.0f} N)"
    return f"{pressed}, then thrown off for {reference:.0f} ms; {found}."


def both(results: Results, wbm: str) -> str:
    """Say what friction and lift-off do together."""
    parts = []
    for one in results.combinations():
        share = [
            results.value("time without contact", wbm, results.networks(wbm)[0], one, "unilateral", field)
            for field in ("reference", "value")
        ]
        fit = results.worst_fit(wbm, one, "unilateral")
        word = "usable" if fit >= results.settings.usable_fit else "not usable"
        twin = number(results.fit(wbm, TWIN, one, "unilateral"), 0)
        parts.append(
            f"{one.friction}, amplitude {one.amplitude:g}: {word}, FIT {number(fit, 0)} % (twin {twin} %), "
            f"{share[1]:.1f} % without contact in place of {share[0]:.1f} %"
        )
    return "; ".join(parts) + "." if parts else "Not tried."


ANSWERS: tuple[tuple[str, Answer], ...] = (
    ("Friction in the base joint: is the contact force usable?", friction),
    ("Friction: and the other signals?", other_signals),
    ("Friction: and the mean contact force?", mean_force),
    ("Friction: is there hysteresis?", hysteresis),
    (f"Lift-off at {TORQUE:g} N.m: is every single bounce right?", single_bounces),
    ("Lift-off: are the statistics right?", statistics),
    ("Lift-off with unilateral left off?", ignored),
    ("Lift-off under a larger static force?", torque),
    ("A raised wire?", raised),
    ("A dropped wire?", dropped),
    ("Friction and lift-off together?", both),
)
