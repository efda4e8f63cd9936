"""What the pages say in words."""

from __future__ import annotations

from cosimulation.pantograph import operating_point_name
from cosimulation.report import thesis
from cosimulation.study.compare.settings import CompareSettings
from cosimulation.study.limits import plural


def boxes(settings: CompareSettings) -> str:
    """Return what Figure 4.35 shows."""
    signals = settings.signals()
    span = signals[0].high - signals[0].low
    slow, fast = min(settings.slew_rates), max(settings.slew_rates)
    passes = [rate * settings.signal_duration / span for rate in (slow, fast)]
    return (
        f"The thesis takes twelve test signals of 70 s. Here they are {len(signals)} of "
        f"{settings.signal_duration:g} s: the height goes up and down between {signals[0].low:g} m and "
        f"{signals[0].high:g} m, at one speed in each, {slow:g} to {fast:g} m/s ({passes[0]:.1f} to "
        f"{passes[1]:.1f} passes of the range), with the noise of the recipe on height and torque, every "
        "signal its own. No model has seen them. For comparison: a wire that falls by 1:500 moves at "
        "0.11 m/s under a train at 200 km/h. "
        f"Models are numbered as in the thesis: M11 to M1{len(settings.linearised_at)} are the white-box "
        f"model linearised at {', '.join(map(operating_point_name, settings.linearised_at))}, with the mean "
        "error of every signal subtracted after the simulation, as the thesis does; M2 surrogates, M3 n4sid "
        "networks with output blending, M4 with parameter blending, all of four local models; the last digit "
        f"is the draw of training data ({plural(len(settings.seeds), 'draw')}). "
        "L11 is LOLIMOT, the thesis's first attempt, on xi: it has one output, from which F_p follows."
    )


TIMES = (
    "Wall time over the time that was simulated. All are FMUs, run in turn in one process; the fastest run "
    "of each counts. The first columns: one call into a loop in C that sets both inputs, reads all outputs "
    "and does a step for every row of 1 ms, initialisation included. Beside it fmpy's own loop "
    "(simulate_fmu) over the same rows, which is Python: there the program around the FMU takes nearly all "
    "of the time. The thesis's figures are those of its computer and programs; its n4sid network blends "
    "outputs, with low-pass and look-up table, and by Remark 4.6.4 a linearised model is about as fast as "
    "the surrogate."
)


def all_signals(settings: CompareSettings) -> str:
    """Return what Table 4.5 shows."""
    name = operating_point_name(settings.operating_point)
    return (
        "FIT on the last 75 % of the samples, of the models from the first draw; the thesis's below. One "
        f"local model is identified and validated at one operating point ({name}; Figures 4.2 and 4.3 of the "
        "thesis show OP65), four through the whole range. The thesis's n4sid networks were not trained on "
        "whole-range data; here these decide how the local models are blended."
    )


BEST = (
    "FIT of F_p on the whole-range validation data of the first draw: the best of the models, as the thesis "
    "lists it, and their median. These data took part in one choice: whether the surrogate of that draw is "
    "taken as the frequency response gives it, or tuned. " + thesis.LINEAR_REMARK
)
FORCE = (
    "Of the first test signal and the models that the thesis calls previously examined: M11, M21, M31, M41."
)
POLES = (
    "The local models' poles, and below as numbers: frequency [Hz], damping ratio. In the thesis the "
    "surrogate had two real poles in place of a pair (Remark 4.7.1)."
)
DIFFERENCES = (
    "The white-box model is another one; the thesis's own was not at hand. The thesis does not say how fast "
    "its test signals move. It starts M22 and M23 from the parameters of M21; here the search of every "
    "surrogate starts from a closed form, without random numbers, so each is identified afresh. It adapted "
    "the matrices of M31 by hand to blend them in M41; here they are aligned automatically, so that there "
    "are M42, M43 and so on. Its networks get their offsets by a low-pass and a look-up table; here they "
    "count from the equilibrium at the present height, and T31 is M31 in the thesis's way."
)
