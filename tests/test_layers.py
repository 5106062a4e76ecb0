"""Imports point one way, Taichi lives in one directory, rooms and functions stay small, and the build
map equals the tree.
"""

import ast
import functools
import re
import subprocess
import sys
import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = {"mcsettle": "mcsettle", "kernels": "mcsettle.kernels", "cli": "mcsettle.cli"}
STUDIES = {
    "studies": "mcsettle.studies"
}  # installed for its studies; its scripts are not the model
# A room may import the rooms before it, and its own modules; nothing else.
ROOMS = (
    *("errors", "units", "types", "storage", "railway", "economics", "estimate", "step_a"),
    *(
        "verification",
        "kernels",
        "step_b",
        "study",
        "summary",
        "run",
        "analysis",
        "report",
        "cli",
        "__main__",
    ),
)
RANK = {room: rank for rank, room in enumerate(ROOMS)}


def sources() -> list[tuple[str, Path]]:
    """(module name as installed, file) of every source file."""
    found = []
    for folder, package in PACKAGES.items():
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            found.append((".".join([package, *(p for p in parts if p != "__init__")]), path))
    return found


SOURCES = sources()


@functools.cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@functools.cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(tree_of(path)))


def imported(path: Path, typing: bool = False) -> set[str]:
    """Every name that ``path`` imports; ``typing``: those under ``if TYPE_CHECKING`` too."""
    hidden = {
        inner
        for node in nodes_of(path)
        if not typing and isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        for inner in ast.walk(node)
    }
    names: set[str] = set()
    for node in set(nodes_of(path)) - hidden:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            own = f"{PACKAGES[path.relative_to(ROOT).parts[0]]}." if node.level else ""
            names |= {f"{own}{node.module}.{alias.name}" for alias in node.names}
    return names


def home_of(name: str, modules: set[str]) -> str:
    """Module that an imported name is, or is defined in; "" where it is not ours."""
    return next((home for home in (name, name.rpartition(".")[0]) if home in modules), "")


def room_of(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


@pytest.mark.parametrize(("module", "path"), SOURCES, ids=[m for m, _ in SOURCES])
def test_imports_point_one_way(module: str, path: Path) -> None:
    own = room_of(module)
    if not own:  # the package itself names everything, lazily
        return
    assert own in RANK, f"{own} is not a room: add it to ROOMS where it belongs"
    for name in imported(path, typing=True):
        if name.startswith("mcsettle.") and room_of(name) in RANK:
            assert RANK[room_of(name)] <= RANK[own], f"{module} imports {name} from a later room"


def test_no_module_imports_itself_by_way_of_others() -> None:
    modules = {module for module, _ in SOURCES}
    graph = {
        module: {home_of(name, modules) for name in imported(path)} - {module, ""}
        for module, path in SOURCES
        if room_of(module)
    }
    TopologicalSorter(graph).prepare()  # CycleError names the circle


@pytest.mark.parametrize(("module", "path"), SOURCES, ids=[m for m, _ in SOURCES])
def test_one_module_names_the_runtimes_and_nothing_is_imported_bare(
    module: str, path: Path
) -> None:
    tops = {name.split(".")[0] for name in imported(path)}
    assert not tops & {"taichi", "quadrants", "kernels", "cli"}


@pytest.mark.parametrize("path", sorted((ROOT / "tests").rglob("*.py")), ids=lambda p: p.name)
def test_tests_import_nothing_bare(path: Path) -> None:
    assert not {name.split(".")[0] for name in imported(path)} & {"kernels", "cli"}


# --- sizes ----------------------------------------------------------------------------------------

MODULE, FUNCTION, KERNEL = 400, 60, 80  # most lines of a module, of a function, of one in kernels/
# Functions outside study/, cli/ and report/ that take a Study. This number only falls.
STUDY_TAKERS = 33


def functions(path: Path) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    return [n for n in nodes_of(path) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]


def test_modules_and_functions_are_short() -> None:
    longer = []
    for module, path in SOURCES:
        if len(path.read_text(encoding="utf-8").splitlines()) > MODULE:
            longer.append(module)
        most = KERNEL if room_of(module) == "kernels" else FUNCTION
        longer += [
            f"{module}.{function.name}"
            for function in functions(path)
            if function.end_lineno - function.lineno + 1 > most
        ]
    assert longer == []


def test_the_top_of_the_package_is_small() -> None:
    top = [path for path in (ROOT / "mcsettle").iterdir() if path.name != "__pycache__"]
    assert len(top) <= 19
    assert len([path for path in top if path.suffix == ".py" and path.stem != "__init__"]) <= 6


@pytest.mark.parametrize("room", [r for r in ROOMS if (ROOT / "mcsettle" / r).is_dir()])
def test_a_rooms_door_says_what_it_is_and_no_more(room: str) -> None:
    door = ROOT / "mcsettle" / room / "__init__.py"
    (only,) = tree_of(door).body
    assert isinstance(only, ast.Expr)
    assert isinstance(only.value, ast.Constant)
    assert 10 <= len(door.read_text(encoding="utf-8").splitlines()) <= 14


def takes_a_study(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    given = function.args
    return any(
        isinstance(node, ast.Name) and node.id == "Study"
        for argument in (*given.posonlyargs, *given.args, *given.kwonlyargs)
        if argument.annotation is not None
        for node in ast.walk(argument.annotation)
    )


def test_few_functions_take_a_study() -> None:
    takers = [
        f"{module}.{function.name}"
        for module, path in SOURCES
        if room_of(module) not in ("study", "report", "cli")
        for function in functions(path)
        if takes_a_study(function)
    ]
    assert len(takers) <= STUDY_TAKERS, takers
    assert len(takers) > STUDY_TAKERS - 10, f"{len(takers)}: lower the number"


# All that run/ calls of study/, and of the study's own methods: a run's walk through study/.
ASKED = {"run_inputs", "candidates_of", "with_run", "with_values"}
BEFORE_AND_BESIDE = {"extent_of"}  # of a folder that is looked at, or a plan that is made


def test_a_run_asks_a_study_once() -> None:
    """Factor digests are asked by ``check``, not by a run."""
    files = [path for m, path in SOURCES if m.startswith("mcsettle.run.")]
    files.remove(ROOT / "mcsettle" / "run" / "factor_digest.py")
    called = {
        node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
        for path in files
        for node in nodes_of(path)
        if isinstance(node, ast.Call)
    }
    of_study = {
        function.name
        for module, path in SOURCES
        if module.startswith("mcsettle.study.")
        for function in functions(path)
    }
    elsewhere = {
        function.name
        for module, path in SOURCES
        if not module.startswith("mcsettle.study.")
        for function in functions(path)
    }
    assert (called & of_study) - elsewhere == ASKED | BEFORE_AND_BESIDE


# --- tests ----------------------------------------------------------------------------------------


def patches(path: Path) -> set[tuple[str, str]]:
    """(module, name) of everything of ours that a test file replaces by ``setattr``."""
    alias, pairs = {}, set()
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom):
            alias |= {a.asname or a.name: f"{node.module}.{a.name}" for a in node.names}
    for node in nodes_of(path):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "setattr":
            where, name = node.args[0], getattr(node.args[1], "value", None)
            if isinstance(where, ast.Constant):
                pairs.add(tuple(where.value.rsplit(".", 1)))
            elif isinstance(where, ast.Name) and isinstance(name, str):
                pairs.add((alias.get(where.id, ""), name))
    return pairs


@functools.cache
def look_ups() -> set[tuple[str, str]]:
    """(module, name) of every name that is looked up when it is used: replacing it is noticed.

    That is by a module's own functions, by ``module.name`` elsewhere (the module by its last name),
    and by imports inside functions. What others import at their top is bound there and stays what it was.
    """
    pairs = set()
    for module, path in SOURCES:
        for node in nodes_of(path):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                pairs.add((module, node.id))
            elif isinstance(node, ast.Attribute):
                pairs.add((ast.unparse(node.value).rpartition(".")[2], node.attr))
            elif isinstance(node, ast.ImportFrom) and node.col_offset > 0:
                pairs |= {(str(node.module), a.name) for a in node.names}
    return pairs


def test_what_a_test_replaces_is_looked_up_there() -> None:
    modules = {module for module, _ in SOURCES}
    replaced = {
        pair
        for path in sorted((ROOT / "tests").rglob("*.py"))
        for pair in patches(path)
        if pair[0] in modules
    }
    assert len(replaced) > 20
    unseen = [
        f"{module}.{name}"
        for module, name in sorted(replaced)
        if not look_ups() & {(module, name), (module.rpartition(".")[2], name)}
    ]
    assert unseen == []


def test_no_postponed_annotations_in_kernels() -> None:
    for module, path in SOURCES:
        if room_of(module) == "kernels":
            assert "__future__.annotations" not in imported(path), path


def test_package_list_equals_the_tree() -> None:
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "setuptools"
    ]
    folders = {path.parent.relative_to(ROOT) for _, path in SOURCES}
    tree = {
        ".".join([PACKAGES[folder.parts[0]], *folder.parts[1:]])
        for folder in folders
        if folder.parts
    }
    assert set(build["packages"]) == tree | set(STUDIES.values())
    homes = PACKAGES | STUDIES
    assert build["package-dir"] == {package: folder for folder, package in homes.items()}


def test_every_study_and_its_data_are_installed() -> None:
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "setuptools"
    ]
    patterns = build["package-data"]["mcsettle.studies"]
    data = {
        path
        for path in (ROOT / "studies").rglob("*")
        if path.is_file()
        and path.suffix not in (".py", ".pyc", ".md")
        and path.name != "study.schema.json"  # made with the environment, for editors
    }
    installed = {path for pattern in patterns for path in (ROOT / "studies").glob(pattern)}
    assert data == installed


def test_every_public_name_is_there() -> None:
    import mcsettle

    for name in mcsettle.__all__:
        assert getattr(mcsettle, name) is not None
    assert set(mcsettle.__all__) <= set(dir(mcsettle))
    homes = {f"{home}.{name}" for name, home in mcsettle._HOME.items()}
    typed = imported(Path(mcsettle.__file__), typing=True) - imported(Path(mcsettle.__file__))
    assert typed == homes, "type checkers see other names than Python"
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        mcsettle.nothing  # noqa: B018


def test_versions_agree() -> None:
    import mcsettle

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    version = project["version"]
    assert version == mcsettle.__version__
    told = {name: (ROOT / name).read_text(encoding="utf-8") for name in PEOPLE_READ}
    assert f"\nversion: {version}\n" in told["CITATION.cff"]
    assert f"## [{version}]" == re.search(r"^## \[.*", told["CHANGELOG.md"], re.MULTILINE)[0]
    python = "Programming Language :: Python :: 3."
    minors = [int(c.removeprefix(python)) for c in project["classifiers"] if c.startswith(python)]
    assert project["requires-python"] == f">=3.{minors[0]},<3.{minors[-1] + 1}"
    assert minors == [*range(minors[0], minors[-1] + 1)]
    for page in ("README.md", "docs/guide/start.md"):
        assert f"Python 3.{minors[0]} to 3.{minors[-1]}" in told[page]
        assert f"mcsettle-{version}-py3-none-any.whl" in told[page]


PEOPLE_READ = ("CITATION.cff", "CHANGELOG.md", "README.md", "docs/guide/start.md")
LOADED = (
    "import sys; {}; "
    "print(sorted({{m.split('.')[0] for m in sys.modules}} & {{'taichi', 'quadrants', 'numpy'}}))"
)


@pytest.mark.parametrize(
    "statement",
    [
        "import mcsettle",
        "import mcsettle.cli.app as a; from typer.testing import CliRunner;"
        " assert CliRunner().invoke(a.app, ['--help']).exit_code == 0",
    ],
    ids=["import", "help"],
)
def test_import_and_help_load_neither_taichi_nor_numpy(statement: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOADED.format(statement)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_a_study_is_read_without_taichi(toy_path: Path) -> None:
    statement = f"from mcsettle import load_study; load_study({str(toy_path)!r}).trains"
    done = subprocess.run(
        [sys.executable, "-c", LOADED.format(statement)], capture_output=True, text=True, check=True
    )
    assert "taichi" not in done.stdout
