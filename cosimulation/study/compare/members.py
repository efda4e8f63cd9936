"""The models that are compared, by the thesis's numbers (4.8), each of them as an FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cosimulation.automatic import automatic_network
from cosimulation.candidates import (
    Candidate,
    head_forces,
    identifier,
    identify_candidates,
    linearised,
    n4sid_labels,
    surrogate_labels,
)
from cosimulation.data_folder import DataFolder
from cosimulation.fmu_file import open_fmu
from cosimulation.pantograph import DESCRIPTIONS, INPUTS
from cosimulation.settings import GenerateSettings
from cosimulation.study.surrogate.physics import head_of
from fmu_builder.compiler import host_platform
from fmu_builder.llmn_fmu import build_llmn
from identification import n4sid, surrogate
from identification.lolimot import lolimot_parameter_set
from identification.network import NetworkSettings

LINEAR, SURROGATE, OUTPUT, PARAMETER = "linear", "surrogate", "n4sid_output", "n4sid"
LOW_PASS, LOLIMOT = "n4sid_thesis", "lolimot"
"""Families of models: the first part of the model identifier of their FMUs."""
NUMBERS = {LINEAR: "M1", SURROGATE: "M2", OUTPUT: "M3", PARAMETER: "M4", LOW_PASS: "T3", LOLIMOT: "L1"}
"""Family -> what the labels of its models begin with; a digit follows: the draw, or the height."""
ONE_SURROGATE, ONE_N4SID = "1 LLM surrogate", "1 LLM n4sid"


@dataclass(frozen=True)
class Member:
    """One model of the comparison.

    Attributes:
        label: The thesis's number, M11 to M41; more draws go on from there (M42, M43). T31 is M31 with the
            thesis's low-pass and look-up table; L11 is LOLIMOT, its first attempt, on xi.
        family: A key of `NUMBERS`, or the label of a network with one local model.
        seed: Of its training data.
        candidate: The model; the route of its score records is the label.
        path: Its FMU.
    """

    label: str
    family: str
    seed: int
    candidate: Candidate
    path: Path


def in_thesis(label: str) -> bool:
    """Return whether Figure 4.35 of the thesis shows a model of this label."""
    return label == "M41" or (label[:2] in ("M1", "M2", "M3") and label[2:] in ("1", "2", "3"))


def members_of_draws(
    wbm: str,
    draws: Mapping[int, tuple[DataFolder, GenerateSettings]],
    fmu: Path,
    heights: Sequence[float],
    folder: Path,
) -> list[Member]:
    """Return the models, identified from every draw of training data: the thesis's in its order, then others.

    Args:
        wbm: The white-box set.
        draws: Seed -> data and their settings.
        fmu: The white-box FMU.
        heights: At which it is linearised as a whole [m].
        folder: Takes models/SET and fmus/SET.
    """
    found: list[tuple[str, str, int, Candidate]] = []
    first = next(iter(draws))
    with open_fmu(fmu) as opened:
        for index, height in enumerate(heights):
            data, settings = draws[first]
            model = linearised(wbm, data, opened, settings, head_forces(wbm), height)
            found.append((f"{NUMBERS[LINEAR]}{index + 1}", LINEAR, first, model))
        for index, (seed, (data, settings)) in enumerate(draws.items()):
            models = {one.name: one for one in identify_candidates(wbm, data, opened, settings)}
            for family in (SURROGATE, OUTPUT, PARAMETER, LOW_PASS):
                if family != LOW_PASS or seed == first:
                    model = models[identifier(family, wbm)]
                    found.append((f"{NUMBERS[family]}{index + 1}", family, seed, model))
    found.append((f"{NUMBERS[LOLIMOT]}1", LOLIMOT, first, _lolimot(wbm, draws[first][0])))
    return [
        _built(wbm, *one, folder) for one in sorted(found, key=lambda one: (not in_thesis(one[0]), one[0]))
    ]


def _lolimot(wbm: str, data: DataFolder) -> Candidate:
    """Return LOLIMOT's network of xi: F_p follows from xi and the height, no other signal does."""
    training = [item.data for item in data.select("whole_range", "train")]
    _, contact_force = head_forces(wbm)
    found = lolimot_parameter_set(identifier(LOLIMOT, wbm), training, INPUTS, "xi", None, [contact_force])
    labels = {
        "wbm": wbm,
        "model": found.kind,
        "llms": len(found.local_models),
        "blending": found.blending,
        "offsets": found.offsets.kind,
        "validity": found.partition.validity,
        "order": found.state_count,
    }
    return Candidate("LOLIMOT on xi", found, labels)


def one_local_model(
    wbm: str, seed: int, data: DataFolder, height: float, folder: Path
) -> tuple[Member, Member]:
    """Return a surrogate and an n4sid model of one operating point (the one-LLM columns of Table 4.5).

    Args:
        wbm: The white-box set.
        seed: Of the data.
        data: Holds operating-point training data at the height.
        height: [m].
        folder: Takes models/SET and fmus/SET.
    """
    training = [item.data for item in data.select("operating_point", "train") if item.height == height]
    chosen = n4sid.N4sidSettings(centres=(height,))
    local = n4sid.identify(training, chosen, data.static_map, DESCRIPTIONS)
    forces = head_forces(wbm)
    own = replace(data, experiments=())  # nothing through the whole range: no choices are left open
    black = automatic_network(identifier("one_n4sid", wbm), local, own, NetworkSettings(), forces)
    found = surrogate.identify(local, training, head_of(wbm))
    physical = surrogate.network(identifier("one_surrogate", wbm), found, forces)
    pair = (
        (ONE_SURROGATE, Candidate(ONE_SURROGATE, physical, surrogate_labels(wbm, physical, found))),
        (ONE_N4SID, Candidate(ONE_N4SID, black.parameter_set, n4sid_labels(wbm, black.parameter_set, local))),
    )
    first, second = (_built(wbm, label, label, seed, model, folder) for label, model in pair)
    return first, second


def _built(wbm: str, label: str, family: str, seed: int, candidate: Candidate, folder: Path) -> Member:
    """Write a model's parameter set and FMU."""
    name = label.replace(" ", "_")
    models, fmus = folder / "models" / wbm, folder / "fmus" / wbm
    for place in (models, fmus):
        place.mkdir(parents=True, exist_ok=True)
    candidate.parameter_set.save(models / f"{name}.json")
    path = build_llmn(candidate.parameter_set, fmus / f"{name}.fmu", (host_platform(),))
    labelled = replace(candidate, labels={**candidate.labels, "route": label})
    return Member(label, family, seed, labelled, path)
