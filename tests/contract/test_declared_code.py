"""The code that a key takes in: each list against what the modules in it import and use."""

import ast
from functools import cache
from pathlib import Path

from each import each

from pipelines.archive import keys
from pipelines.archive.code import CODE
from pipelines.chain.chain import BY_NAME

OWN = ("inertial", "schemas", "stations", "pipelines")
STARTS = {
    "validate": "pipelines.stages.validate",
    "reduce": "pipelines.stages.reduce",
    "fit": "pipelines.stages.fit",
    "fit of norms": "pipelines.stages.unknown_poses.fit",
    "fit in a plane": "pipelines.importers.plane",
    "judge": "pipelines.stages.judge",
    "verify": "pipelines.stages.verify",
    "verify of norms": "pipelines.stages.unknown_poses.verify",
    "noise": "pipelines.stages.noise",
    "soak_noise": "pipelines.stages.soak_noise",
    "budget": "pipelines.stages.uncertainty.budget",
    "budget of norms": "pipelines.stages.unknown_poses.budget",
    "procedures": "pipelines.stages.procedures pipelines.procedures",
    "grade": "pipelines.stages.grade pipelines.stages.figures",
    "import": "pipelines.importers",
    "import with a fit": "pipelines.importers pipelines.diagnosis.imported_norms",
    "import of waveforms": "pipelines.importers.waveforms pipelines.procedures",
    "import of a transfer function": "pipelines.importers.transfer",
    "report": "pipelines.report.context pipelines.report.interactive pipelines.report.panel pipelines.report.panels "
    "pipelines.report.templates pipelines.report.unit_panels pipelines.certificates.ledger pipelines.procedures",
    "report of an import": "pipelines.report.diagnosis pipelines.report.imported pipelines.diagnosis.diagnose",
    "inquiry": "pipelines.diagnosis.diagnose inertial",
}
"""Where the work of each result begins; modules, and packages whose modules are discovered."""
TABLES = "schemas.tables"  # what is stored is held against its columns
DISCOVERED = ("inertial.effects",)


@cache
def sources(*modules: str) -> dict[str, Path]:
    """Files of modules and of what is below them, by name."""
    return keys.sources(modules)


def _names(node: ast.AST, used: set[str], imported: list[ast.ImportFrom | ast.Import]) -> None:
    """Names that run, and imports; annotations and blocks for type checkers are left out."""
    if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
        return
    if isinstance(node, ast.Import | ast.ImportFrom):
        imported.append(node)
    elif isinstance(node, ast.Name):
        used.add(node.id)
    for field, value in ast.iter_fields(node):
        if field not in {"annotation", "returns"}:
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    _names(child, used, imported)


@cache
def _imports(module: str) -> frozenset[str]:
    path = sources(module)[module]
    used: set[str] = set()
    imported: list[ast.ImportFrom | ast.Import] = []
    _names(ast.parse(path.read_text("utf-8")), used, imported)
    found = set()
    for node in imported:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif path.name == "__init__.py" or any((alias.asname or alias.name) in used for alias in node.names):
            found |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(name for name in found if name.split(".")[0] in OWN and name in ALL)


ALL = set(sources(*OWN))


@cache
def _without_code(module: str) -> bool:
    """Whether a module is a package's first file with nothing but a docstring."""
    path = sources(module)[module]
    return path.name == "__init__.py" and len(ast.parse(path.read_text("utf-8")).body) <= 1


def needed(starts: str) -> set[str]:
    """Modules that run, with what they import, at any depth."""
    left = [name for start in (*starts.split(), TABLES) for name in sources(start)]
    found: set[str] = set()
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            left += _imports(name)
            left += sources(name) if name in DISCOVERED else ()
    return {name for name in found if not _without_code(name)}


@each(CODE)
def test_a_key_takes_in_every_module_that_its_result_runs_and_no_room_that_it_does_not_use(result: str) -> None:
    assert set(BY_NAME) <= set(CODE) == set(STARTS)
    run = needed(STARTS[result])
    assert sorted(run - set(sources(*CODE[result]))) == []
    assert [name for name in CODE[result] if not run & set(sources(name))] == []
