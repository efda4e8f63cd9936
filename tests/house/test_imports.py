"""The arrows between the rooms point one way."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("fmu_builder", "identification", "cosimulation", "fmus")
SHARED = {"fmu_builder.errors", "fmu_builder.files"}
ALLOWED = {
    "fmu_builder/parameter_set": {"fmu_builder.parameter_set"},
    "fmu_builder/fmi2": {"fmu_builder.fmi2", "fmu_builder.compiler"},
    "fmu_builder/kernel": {"fmu_builder.kernel", "fmu_builder.parameter_set", "fmu_builder.compiler"},
    "fmu_builder": {"fmu_builder"},
    "identification": {
        "identification",
        "fmu_builder.parameter_set",
        "fmu_builder.kernel",
        "fmu_builder.compiler",
    },
    "fmus": {"fmus", "fmu_builder", "identification.stability"},
    "cosimulation": {"cosimulation", "identification", "fmus", "fmu_builder"},
}
LIBRARIES_KEPT_OUT = {
    "fmu_builder/parameter_set": {"fmpy", "scipy", "control"},
    "fmu_builder/kernel": {"fmpy", "scipy", "control"},
    "identification": {"fmpy"},
}


def imported_modules(source: str) -> set[str]:
    """Names of all modules that a file imports, wherever in the file it does so."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise AssertionError("relative imports hide the room a name comes from")
            found.add(node.module or "")
            found |= {f"{node.module}.{name.name}" for name in node.names}
    return found


def room_of(path: Path) -> str:
    """The narrowest room in the table that a file belongs to."""
    relative = path.relative_to(ROOT).as_posix()
    return max((room for room in ALLOWED if relative.startswith(room + "/")), key=len)


def violations(room: str, modules: set[str]) -> set[str]:
    """Modules of ours, or libraries, that a file in `room` must not import."""
    ours = {name for name in modules if name.split(".")[0] in ROOMS}
    allowed = ALLOWED[room] | SHARED

    def is_allowed(name: str) -> bool:
        return any(name == door or name.startswith(door + ".") for door in allowed) or any(
            door.startswith(name + ".") and name in ROOMS for door in allowed
        )

    wrong = {name for name in ours if not is_allowed(name)}
    return wrong | {name for name in modules if name.split(".")[0] in LIBRARIES_KEPT_OUT.get(room, set())}


FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_file_imports_only_from_rooms_it_may(path: Path) -> None:
    assert violations(room_of(path), imported_modules(path.read_text(encoding="utf-8"))) == set()


def test_the_rule_sees_an_arrow_that_points_back() -> None:
    assert violations("fmu_builder", {"identification.scores"}) == {"identification.scores"}
    assert violations("identification", {"fmu_builder.fmi2"}) == {"fmu_builder.fmi2"}
    assert violations("identification", {"fmpy"}) == {"fmpy"}
    assert violations("fmus", {"cosimulation"}) == {"cosimulation"}
    assert violations("cosimulation", {"fmu_builder.fmi2", "identification"}) == set()


def test_there_are_no_import_circles() -> None:
    graph = {
        path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".").removesuffix(".__init__"): path
        for path in FILES
    }
    edges = {
        name: {module for module in imported_modules(path.read_text(encoding="utf-8")) if module in graph}
        - {name}
        for name, path in graph.items()
    }
    done: set[str] = set()

    def walk(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, " -> ".join([*trail, name])
        if name in done:
            return
        for other in sorted(edges[name]):
            # a package's door re-exports its files; only the file-to-file arrows can form a circle
            if graph[other].name != "__init__.py":
                walk(other, (*trail, name))
        done.add(name)

    for name in sorted(graph):
        walk(name, ())
