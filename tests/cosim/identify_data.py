"""Short data folders for `llmn identify`, and its settings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from cosim.whole_path import WholePath
from cosimulation.identify import IdentifySettings
from cosimulation.settings import parse_settings
from identification.data_set import DataSet

HEAD = {"m_C": 5.419, "k_C": 6724.0, "c_C": 29.21}


def settings(folder: Path, **values: Any) -> IdentifySettings:
    given = {"name": "mine", "data": folder / "data", "output": folder / "mine.json", "head": HEAD, **values}
    return parse_settings(IdentifySettings, given, "test")


def write_data(
    blow: WholePath, folder: Path, whole_range: bool = True, static_map: bool = True, **change: Any
) -> Path:
    """A data folder of 8 s at every height; `change` maps an experiment's name to what to do with it."""
    experiments = []
    for item in blow.data.experiments:
        if item.split != "train" or (item.kind == "whole_range" and not whole_range):
            continue
        data = item.data.rows(0, 8000 if item.kind == "operating_point" else 40000)
        shorter = replace(
            item, data=DataSet(item.name, data.sample_time, data.names, data.units, data.values)
        )
        changed = change[item.name](shorter.data) if item.name in change else shorter.data
        if changed is not None:
            experiments.append(replace(shorter, data=changed))
    known = replace(
        blow.data,
        experiments=tuple(experiments),
        static_map=blow.data.static_map if static_map else None,
    )
    (folder / "data").mkdir()
    known.save(folder / "data")
    return folder
