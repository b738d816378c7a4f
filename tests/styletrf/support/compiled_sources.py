"""What is compiled into functions: the names of the project that they use, and where these are."""

import ast
import functools
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

Place = tuple[Path, str]
"""A file, and a name at its top level."""
_DECORATOR = Path("styletrf/compiled.py")


def functions_in(root: Path, file: Path) -> list[str]:
    """Returns the functions of a file that `compiled` decorates, by whatever name."""
    functions = (node for node in ast.walk(_syntax(file)) if isinstance(node, ast.FunctionDef))
    mark = root / _DECORATOR, "compiled"
    return [f.name for f in functions if mark in sources(root, file, _used(*f.decorator_list))]


def sources_outside(root: Path, file: Path) -> set[Place]:
    """Returns what is compiled into the functions of a file from beyond the file's own folder."""
    found = sources(root, file, functions_in(root, file))
    return {(f, n) for f, n in found if f.parent != file.parent and f != root / _DECORATOR}


def sources(root: Path, file: Path, names: Iterable[str]) -> set[Place]:
    """Returns the names that some names of a file depend on, through all files below a root."""
    found: set[Place] = set()
    left = [(file, name) for name in names]
    while left:
        place = left.pop()
        if place not in found:
            found.add(place)
            for statement in _definitions(place[0]).get(place[1], ()):
                if isinstance(statement, ast.Import | ast.ImportFrom):
                    left += _imported(root, statement, place[1])
                else:
                    left += [(place[0], name) for name in _used(statement)]
    return found


@functools.cache
def _syntax(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@functools.cache
def _definitions(file: Path) -> Mapping[str, list[ast.stmt]]:
    """Returns the statements at the top of a file that bind each name, and all of its imports."""
    found: defaultdict[str, list[ast.stmt]] = defaultdict(list)
    tree = _syntax(file)
    for statement in tree.body:
        if isinstance(statement, ast.FunctionDef | ast.ClassDef):
            found[statement.name].append(statement)
        else:
            for node in ast.walk(statement):
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                    found[node.id].append(statement)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                found[_bound_by(alias)].append(node)
    return found


def _bound_by(alias: ast.alias) -> str:
    return alias.asname or alias.name.partition(".")[0]


def _used(*nodes: ast.AST) -> set[str]:
    names = (each for node in nodes for each in ast.walk(node) if isinstance(each, ast.Name))
    return {name.id for name in names if isinstance(name.ctx, ast.Load)}


def _imported(root: Path, statement: ast.Import | ast.ImportFrom, name: str) -> Iterator[Place]:
    """Yields what a name is that a statement imports: one name, or all those of a module."""
    for alias in (each for each in statement.names if _bound_by(each) == name):
        module = f"{statement.module}." if isinstance(statement, ast.ImportFrom) else ""
        path = root.joinpath(*f"{module}{alias.name}".split("."))
        if (file := _file_of(path)) is not None:
            yield from ((file, each) for each in _definitions(file))
        elif (file := _file_of(path.parent)) is not None:
            yield file, path.name


def _file_of(module: Path) -> Path | None:
    files = module.parent / f"{module.name}.py", module / "__init__.py"
    return next((file for file in files if file.is_file()), None)
