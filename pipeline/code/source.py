"""The top-level names of a Python module, which is parsed and never imported."""

import ast
import functools
import importlib.util
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

Symbol = tuple[str, ...]
"""A module, and the names to follow inside it."""
Pieces = dict[str, list[ast.stmt]]
"""Statements by the names they bind; by "" all others, such as `TABLE["x"] = f`."""
Imports = dict[str, list[Symbol]]
"""The targets of a name (several after imports inside `try`); `*`: whole modules."""
_PARAMETER_MODULES = ("luigi.", "pipeline.parameters.")


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """One module without its docstrings. Equal texts share one object.

    Attributes:
        package: The package at which its relative imports start.
        bindings: Its functions, classes and constants.
        members: The methods and constants of each class, without `x = luigi.SomeParameter()`, whose
            value is in the key; by "" also its decorators, and other statements for its name.
        imports: The names that its imports outside functions and classes bind.
    """

    package: str
    bindings: Pieces
    members: Mapping[str, Pieces]
    imports: Imports


@dataclass(frozen=True, slots=True)
class Piece:
    """The content of a piece of code, before its names are resolved.

    Attributes:
        text: The `ast.dump` of its syntax tree; empty if there is no code.
        imports: The names that its own import statements bind.
        names: Its dotted names, with repetitions.
        strings: Its constants, as strings.
        calls_with_constant: The names it calls with one constant only, with repetitions.
    """

    text: str
    imports: Imports
    names: tuple[Symbol, ...]
    strings: frozenset[str]
    calls_with_constant: tuple[str, ...]


@functools.cache
def piece(source: Source, *names: str) -> Piece:
    """Returns the code under a top-level name, or under a class and its member."""
    pieces = source.members[names[0]] if names[1:] else source.bindings
    body = pieces.get(names[-1], []) if names else []
    code = ast.Module(body, [])
    parts = list(ast.walk(code))
    calls = [part for part in parts if isinstance(part, ast.Call)]
    called = [call.func for call in calls if [*map(type, call.args)] == [ast.Constant]]
    return Piece(
        ast.dump(code) if body else "",
        imports_in(code, source.package),
        tuple(dotted_names(code)),
        frozenset(str(part.value) for part in parts if isinstance(part, ast.Constant)),
        tuple(map(ast.unparse, called)),
    )


def read(module: str) -> Source | None:
    """Reads the source of a module; None if it is not a module, such as a name inside one."""
    file = source_file(module)
    return _parse(file.read_bytes(), module, file.name == "__init__.py") if file else None


def source_file(module: str) -> Path | None:
    """Returns the path of a module's source, which is found without an import."""
    root, *rest = module.split(".")
    spec = importlib.util.find_spec(root)
    places = (spec and spec.submodule_search_locations) or ()
    folders = [Path(place, *rest) for place in places]
    files = [file for path in folders for file in (path / "__init__.py", path.with_suffix(".py"))]
    if spec and spec.origin and not rest:
        files.append(Path(spec.origin))
    return next((file for file in files if file.suffix == ".py" and file.is_file()), None)


def package_files(package: str) -> dict[str, Path]:
    """Returns the files of a package by name, without the caches of Python and numba."""
    file = source_file(package)
    if file is None or file.name != "__init__.py":
        return {package: file} if file else {}
    folder = file.parent
    return {f"{package}/{path.relative_to(folder).as_posix()}": path for path in _files(folder)}


def _files(folder: Path) -> Iterator[Path]:
    """Yields the files below a folder, without the caches of Python and numba."""
    for path in folder.iterdir():
        if path.is_dir() and path.name != "__pycache__":
            yield from _files(path)
        elif path.is_file():
            yield path


def data_files(package: str) -> dict[str, Path]:
    """Returns the files of a package by name that are not code, source or compiled."""
    files = package_files(package)
    return {name: path for name, path in files.items() if path.suffix not in (".py", ".pyc")}


def imports_in(node: ast.AST, package: str) -> Imports:
    """Returns the names that the imports in `node` bind; by "" the modules that they run."""
    found: Imports = {}
    for part in ast.walk(node):
        if isinstance(part, ast.Import):
            for alias in part.names:
                top = alias.name if alias.asname else alias.name.split(".")[0]
                found.setdefault(alias.asname or top, []).append((top,))
                found.setdefault("", []).append((alias.name,))
        elif isinstance(part, ast.ImportFrom):
            module = importlib.util.resolve_name("." * part.level + (part.module or ""), package)
            for alias in part.names:
                found.setdefault(alias.asname or alias.name, []).append((module, alias.name))
    return found


def dotted_names(node: ast.AST) -> Iterator[Symbol]:
    """Yields the names in a piece of code: `a.b.c` as one name; `super().x` as `self.x`."""
    names: Symbol = ()
    while isinstance(node, ast.Attribute):
        names, node = (node.attr, *names), node.value
    if isinstance(node, ast.Name):
        yield node.id, *names
    elif names and ast.unparse(node) == "super()":
        yield "self", *names
    else:
        for child in ast.iter_child_nodes(node):
            yield from dotted_names(child)


@functools.cache
def _parse(text: bytes, module: str, is_package: bool) -> Source:  # noqa: FBT001
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(body := getattr(node, "body", None), list):
            body[:] = [part for part in body if not _is_string(part)] or [ast.Pass()]
    plain = [part for part in tree.body if not hasattr(part, "decorator_list")]
    package = module if is_package else module.rpartition(".")[0]
    imports = imports_in(ast.Module(plain, []), package)
    bindings = _pieces(p for p in tree.body if not isinstance(p, ast.Import | ast.ImportFrom))
    classes = [part for part in tree.body if isinstance(part, ast.ClassDef)]
    members = {part.name: _members(part, bindings[part.name], imports) for part in classes}
    return Source(package, bindings, members, imports)


def _members(definition: ast.ClassDef, binders: list[ast.stmt], imports: Imports) -> Pieces:
    around = ast.ClassDef(definition.name, [], definition.keywords, [], definition.decorator_list)
    pieces = _pieces(part for part in definition.body if not _is_parameter(part, imports))
    others = [statement for statement in binders if statement is not definition]
    return {**pieces, "": [*pieces.get("", []), around, *others]}


def _is_string(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str)


def _is_parameter(statement: ast.stmt, imports: Imports) -> bool:
    """Whether a statement is `x = luigi.SomeParameter()`, or uses `pipeline.parameters`."""
    call = getattr(statement, "value", None)
    if not isinstance(call, ast.Call) or not ast.unparse(call.func).endswith("Parameter"):
        return False
    heads = [name for name, *_ in dotted_names(call.func)]
    origins = {target[0] for name in heads for target in imports.get(name, [])}
    return bool(origins) and all(f"{origin}.".startswith(_PARAMETER_MODULES) for origin in origins)


def _pieces(statements: Iterable[ast.stmt]) -> Pieces:
    pieces: Pieces = {}
    for statement in statements:
        for name in _names_bound_by(statement):
            pieces.setdefault(name, []).append(statement)
    return pieces


def _names_bound_by(statement: ast.stmt) -> set[str]:
    match statement:
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            return {statement.name}
        case ast.Assign() | ast.AnnAssign() | ast.AugAssign():
            kinds = ast.AnnAssign | ast.AugAssign | ast.NamedExpr
            targets = [part.target for part in ast.walk(statement) if isinstance(part, kinds)]
            parts = [
                n for made in (*targets, *getattr(statement, "targets", [])) for n in ast.walk(made)
            ]
            stored = [n for n in parts if isinstance(getattr(n, "ctx", None), ast.Store)]
            names = {n.id for n in stored if isinstance(n, ast.Name)}
            alters = any(isinstance(n, ast.Subscript | ast.Attribute) for n in stored)
            return names | {""} if alters or isinstance(statement, ast.AugAssign) else names
    return {""}
