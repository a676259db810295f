"""The rooms of the Python tools point one way, and no files import each other in a loop."""

import ast
from graphlib import TopologicalSorter

import pytest

from tools.common import paths

# Each room may import from itself and from those named with it.
ROOMS = {"tools.common": (), "tools.image": ("tools.common",), "tools.bench": ("tools.common", "tools.image"),
         "tools.live": ("tools.common", "tools.image", "tools.bench", "tuning"), "tuning": ("tools.common", "tools.bench")}
MODULES = {f"{room}.{path.stem}": path for room in ROOMS for path in sorted((paths.ROOT / room.replace(".", "/")).glob("[!_]*.py"))}


def imports(module: str) -> set[str]:
    """The project's modules that a module names in an import, wherever it stands."""
    found = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            base = ".".join([*module.split(".")[:-node.level], node.module or ""]).strip(".") if node.level else node.module
            found |= {base, *(f"{base}.{name.name}" for name in node.names)}
        elif isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
    return (found & MODULES.keys()) - {module}


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_from_those_below_it_and_no_files_import_each_other_in_a_loop(room):
    known = {module: imports(module) for module in MODULES if module.rpartition(".")[0] == room}
    assert not [(module, other) for module in known for other in known[module] if other.rpartition(".")[0] not in (room, *ROOMS[room])]
    TopologicalSorter(known).prepare()
