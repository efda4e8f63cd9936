"""The process in which an FMU runs: `python -m fmu_builder.check.behaviour.worker PLAN EXPERIMENT DIARY ...`.

It may crash, hang or print whatever it likes; what it found until then stands in the diary.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from fmu_builder.check.behaviour import deriving, exchange, illegal, saving, starting, timing
from fmu_builder.check.behaviour.diary import Diary
from fmu_builder.check.behaviour.plan import Plan

EXPERIMENTS: Mapping[str, Callable[[Plan, Diary], None]] = {
    "load": starting.load,
    "wrong GUID": starting.wrong_guid,
    "run": starting.run,
    "first output": starting.first_output,
    "reset": starting.reset,
    "two instances": starting.two_instances,
    "set and get": saving.set_get,
    "state": saving.state,
    "state in another process": saving.restore,
    "illegal calls": illegal.illegal_calls,
    "derivatives": deriving.derivatives,
    "communication steps": timing.step_sizes,
    "an hour": timing.hour,
    "model exchange": exchange.model_exchange,
}
"""By name, in the order in which they are done."""


def main(arguments: list[str]) -> None:
    """Run one experiment.

    Args:
        arguments: Plan, name of the experiment, diary, and the calls to leave out.
    """
    plan_path, name, diary_path, *skipped = arguments
    diary = Diary(Path(diary_path), tuple(skipped))
    EXPERIMENTS[name](Plan.from_json(Path(plan_path)), diary)
    diary.done()


if __name__ == "__main__":
    main(sys.argv[1:])
