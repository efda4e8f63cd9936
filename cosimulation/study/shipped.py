"""Study: the networks that come with the project, identified anew and compared by FIT."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field

import fmus
from cosimulation.candidates import n4sid_labels, surrogate_labels
from cosimulation.data_folder import DataFolder
from cosimulation.demo import generate_settings
from cosimulation.generate import make_data
from cosimulation.identify import Identified, IdentifySettings, identify_from_folder
from cosimulation.pantograph import INPUTS, SIGNALS
from cosimulation.settings import load_settings
from cosimulation.study.page import Row, Section, Table, exact
from cosimulation.study.runner import StudySettings, as_json
from fmu_builder.files import write_text
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import ParameterSet
from identification.scores import records

Record = dict[str, Any]
MEASURE = "FIT away from the committed one"


class ShippedSettings(StudySettings):
    """Tables of `shipped.toml`."""

    longest: float | None = Field(
        None, gt=0, description="cuts every experiment to this length, for a quick look [s]"
    )


@dataclass(frozen=True)
class ShippedTask:
    """All networks of one white-box set, on data of one seed.

    Attributes:
        folder: Takes data/SET, and per network models/NAME with what may replace the files in `fmus/NAME`.
        wbm: The white-box set.
        seed: Of every draw.
        settings: The study's.
    """

    folder: Path
    wbm: str
    seed: int
    settings: ShippedSettings


def tasks(settings: ShippedSettings, fmu: Path) -> list[ShippedTask]:
    """Return the independent tasks of the study; it drives the white-box FMU that ships, not `fmu`."""
    results = fmu.parents[1]
    return [
        ShippedTask(results if seed == settings.seeds[0] else results / f"seed_{seed}", wbm, seed, settings)
        for wbm in settings.sets
        for seed in settings.seeds
    ]


def run_task(task: ShippedTask) -> list[Record]:
    """Return score records on test data, and per signal how far the FIT is from the committed one."""
    data, place = _data(task)
    (test,) = data.select("whole_range", "test")
    found: list[Record] = []
    for name in (name for name, wbm in fmus.NETWORKS.items() if wbm == task.wbm):
        result = _identified(name, place, task.folder / "models" / name / "parameters.json")
        labels = {
            **_labels(task.wbm, result),
            "data_set": test.name, "noise": "none", "seed": task.seed, "split": "test", "recommended": True,
        }  # fmt: skip

        def scored(parameter_set: ParameterSet, labels: Record = labels) -> list[Record]:
            order = [parameter_set.output_names.index(signal) for signal in SIGNALS]
            outputs = simulate(parameter_set, test.data.matrix(INPUTS))[:, order]
            return records(test.data.matrix(SIGNALS), outputs, SIGNALS, labels)

        scores = scored(result.parameter_set)
        write_text(result.path.with_name("scores.json"), as_json(scores))
        found += [*scores, *compared(name, scored(fmus.network(name)), scores)]
    return found


def compared(name: str, committed: Sequence[Record], anew: Sequence[Record]) -> Iterable[Record]:
    """Yield how far apart the FIT of a committed network and of one identified anew are, per signal."""
    for old, new in zip(committed, anew, strict=True):
        known = old["fit"] is not None and new["fit"] is not None
        yield {
            "measure": MEASURE,
            "network": name,
            **{key: new[key] for key in ("wbm", "model", "signal", "seed")},
            "committed": old["fit"],
            "anew": new["fit"],
            "value": abs(new["fit"] - old["fit"]) if known else None,
            "unit": "%",
        }


def lines(settings: ShippedSettings, findings: Sequence[Record]) -> list[str]:
    """Return committed and new FIT of every signal for a person."""
    columns = (("committed", 11), ("anew", 11), ("value", 9))
    head = f"{'FIT on test data [%]':<28}{'signal':<10}{'committed':>11}{'anew':>11}{'apart':>9}"
    found = [head]
    for item in findings:
        cells = "".join(f"{exact(_value(item[key])):>{width}}" for key, width in columns)
        name = item["network"] + (f", seed {item['seed']}" if len(settings.seeds) > 1 else "")
        found.append(f"{name:<28}{item['signal']:<10}{cells}")
    return found


def sections(settings: ShippedSettings, _: Sequence[Record], findings: Sequence[Record]) -> list[Section]:
    """Return one section per white-box set: every network as committed and as identified anew."""
    found = []
    for wbm in settings.sets:
        tables = []
        for seed in settings.seeds:
            chosen = [item for item in findings if (item["wbm"], item["seed"]) == (wbm, seed)]
            rows = [
                Row(
                    f"{name}, {how}",
                    [(_value(item[key]), None) for item in chosen if item["network"] == name],
                )
                for name in dict.fromkeys(item["network"] for item in chosen)
                for key, how in (("committed", "committed"), ("anew", "identified anew"))
            ]
            tables.append(Table(f"FIT on test data [%], seed {seed}.", "network", SIGNALS, rows))
        text = (
            "The committed parameter set, and the one identified anew by the same settings, on the same data."
        )
        found.append(Section(f"White-box set {wbm}", text, tables))
    return found


def _data(task: ShippedTask) -> tuple[DataFolder, Path]:
    """Drive the white-box FMU by the acceptance recipe; keep the data."""
    recipe = generate_settings(fmus.path("wbm"), task.wbm, quick=False)
    longest = task.settings.longest or float("inf")
    experiments = tuple(
        item.model_copy(update={"duration": min(item.duration or longest, longest)})
        for item in recipe.experiments
    )
    data = make_data(recipe.model_copy(update={"seed": task.seed, "experiments": experiments}))
    place = task.folder / "data" / task.wbm
    place.mkdir(parents=True)
    data.save(place)
    return data, place


def _identified(name: str, data: Path, output: Path) -> Identified:
    """Do what `llmn identify fmus/NAME/identify.toml` does."""
    settings = load_settings(IdentifySettings, fmus.folder(name) / "identify.toml")
    output.parent.mkdir(parents=True)
    return identify_from_folder(settings.model_copy(update={"data": data, "output": output, "page": False}))


def _labels(wbm: str, result: Identified) -> Mapping[str, Any]:
    if result.surrogate is not None:
        return surrogate_labels(wbm, result.parameter_set, result.surrogate)
    return n4sid_labels(wbm, result.parameter_set, result.local)


def _value(fit: float | None) -> float:
    return float("nan") if fit is None else fit
