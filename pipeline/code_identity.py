"""The identity of a task's code: everything in the project that its `build` can reach.

Names are followed statically, function by function, across the modules of the project, without
importing them (they load torch). Comments, formatting and docstrings do not count. Where a name
cannot be told apart, more is taken than needed: a module used as an object counts whole. Not
followed is what the key holds by value: parameters, and `self.x` in `identity_parameters`' result.
`pipeline` itself is left out: a change there that alters artifacts changes a tag in `record`.
"""

import ast
import re
from collections.abc import Iterator, Mapping

from pipeline.canonical import canonical_json
from pipeline.digest import typed_digest
from pipeline.source import Source, Symbol, imports_in, names_bound_by, read_source

PROJECT = {"styletrf", "tasks"}
IDENTITY = "identity_parameters"


def code_digest(task_class: type) -> str:
    """Digest of the code that `task_class.build` depends on, as the files are now."""
    found = closure(task_class.__module__, task_class.__qualname__)
    return typed_digest("pipeline-code-v1", canonical_json(found))


def closure(module: str, class_name: str, entry: str = "build") -> dict[str, str]:
    """All that the method `entry` of a class depends on: normalised code by qualified name."""
    walk = _Walk(module, class_name)
    walk.take_member(entry)
    while walk.pending:
        walk.visit(*walk.pending.pop())
    return walk.found


class _Walk:
    """From one task's class outwards; `found` is the result, `pending` what is still to read."""

    def __init__(self, module: str, class_name: str) -> None:
        self.task = (module, class_name)
        self.roots = {module.split(".")[0], *PROJECT} - {"pipeline"}
        self.found: dict[str, str] = {}
        self.pending: list[tuple[str, ast.stmt, bool]] = []
        self._followed: set[Symbol] = set()
        self._sources: dict[str, Source | None] = {}

    def visit(self, module: str, statement: ast.stmt, is_member: bool) -> None:  # noqa: FBT001
        """Follow every name in a statement; in a member of the task's class, `self` too."""
        source = self._source(module)
        local = dict(imports_in(statement, source.package)) if source else {}
        for path in _paths(statement):
            if is_member and path[0] in ("self", "cls"):
                self.take_member(path[1] if len(path) > 1 else None)
            else:
                self.follow(self._resolve(module, path, local))

    def follow(self, symbol: Symbol | None) -> None:
        """Take in a top-level name, or all of a module."""
        if symbol is None or symbol in self._followed:
            return
        self._followed.add(symbol)
        module, *names = symbol
        source = self._source(module)
        if source is None:
            return
        self._take(f"{module}:", module, source.effects)
        for name in names or source.bindings:
            self._take(f"{module}:{name}", module, source.bindings[name])
        for name in () if names else source.imports:
            self.follow(self._resolve(module, (name,), {}))

    def take_member(self, member: str | None) -> None:
        """Take in a method or constant of the task's class and its bases; all of them for None."""
        source = self._source(self.task[0])
        if source is None or self.task[1] not in source.bindings:
            self.follow(self.task[:1])
            return
        if member in self._keyed_by_value():
            return
        for module, definition in self._lineage(*self.task):
            chosen = [part for part in definition.body if _belongs_to(member, part)]
            self._take(
                f"{module}:{definition.name}.{member or '*'}", module, chosen, is_member=True
            )

    def _keyed_by_value(self) -> set[str]:
        """The members whose values `identity_parameters` returns: `{"config": self.config}`."""
        keyed = {IDENTITY}
        for _, definition in self._lineage(*self.task):
            for method in (part for part in definition.body if IDENTITY in names_bound_by(part)):
                returns = [part.value for part in ast.walk(method) if isinstance(part, ast.Return)]
                if len(returns) == 1 and isinstance(returns[0], ast.Dict):
                    keyed |= {name for value in returns[0].values for name in _member_in(value)}
                if "super()" not in ast.unparse(method):
                    return keyed
        return keyed

    def _take(
        self, where: str, module: str, statements: list[ast.stmt], *, is_member: bool = False
    ) -> None:
        if statements and where not in self.found:
            self.found[where] = " ".join(ast.dump(statement) for statement in statements)
            self.pending.extend((module, statement, is_member) for statement in statements)

    def _lineage(self, module: str, name: str) -> Iterator[tuple[str, ast.ClassDef]]:
        """The class and its bases in the project, nearest first."""
        source = self._source(module)
        for definition in source.bindings.get(name, []) if source else []:
            if isinstance(definition, ast.ClassDef):
                yield module, definition
                for path in (path for base in definition.bases for path in _paths(base)):
                    if (symbol := self._resolve(module, path, {})) and len(symbol) > 1:
                        yield from self._lineage(symbol[0], symbol[1])

    def _resolve(self, module: str, path: Symbol, local: Mapping[str, Symbol]) -> Symbol | None:
        """Where the dotted path, as read in `module`, is defined; None outside the project."""
        head, *rest = path
        if head in self.roots and head not in local:
            return self._locate(path)  # a string that names a module, or `import styletrf.x`
        if head in local:
            self._note_import(module, head, local[head])
            return self._locate((*local[head], *rest))
        source = self._source(module)
        known = source and (head in source.bindings or head in source.imports)
        return self._locate((module, *path)) if known else None

    def _locate(self, symbol: Symbol) -> Symbol | None:
        """The symbol's defining module and name, through submodules and re-exports."""
        module, *names = symbol
        source = self._source(module)
        if source is None or not names:
            return symbol if source else None
        head, *rest = names
        if head in source.bindings:
            return module, head
        target = source.imports.get(head)
        if target and target != (module, head):
            self._note_import(module, head, target)
            return self._locate((*target, *rest))
        if self._source(f"{module}.{head}"):
            return self._locate((f"{module}.{head}", *rest))
        return (module,)

    def _note_import(self, module: str, name: str, target: Symbol) -> None:
        self.found[f"{module}:{name} = {'.'.join(target)}"] = ""

    def _source(self, module: str) -> Source | None:
        if module not in self._sources:
            is_ours = module.split(".")[0] in self.roots
            self._sources[module] = read_source(module) if is_ours else None
        return self._sources[module]


def _paths(node: ast.AST) -> Iterator[Symbol]:
    """The dotted names in a piece of code: `a.b.c` whole; `super().x` as `self.x`."""
    text = ""
    if isinstance(node, ast.Name | ast.Attribute):
        text = ast.unparse(node).replace("super().", "self.")
    elif isinstance(node, ast.Constant) and "." in str(node.value):
        text = str(node.value)
    if re.fullmatch(r"[^\W\d]\w*(\.\w+)*", text):
        yield tuple(text.split("."))
    else:
        for child in ast.iter_child_nodes(node):
            yield from _paths(child)


def _member_in(value: ast.expr) -> list[str]:
    """`["x"]` for the expressions `self.x` and `self.x()`."""
    text = re.fullmatch(r"self\.(\w+)(\(\))?", ast.unparse(value))
    return [text[1]] if text else []


def _belongs_to(member: str | None, statement: ast.stmt) -> bool:
    """Whether a statement of a class's body makes the member (any, for None).

    Never `name = luigi.SomeParameter(...)`, whose value the key holds by itself; always what binds
    no name we can tell, such as an `if`.
    """
    match statement:
        case ast.Assign(value=ast.Call(func=called)) | ast.AnnAssign(value=ast.Call(func=called)):
            if ast.unparse(called).endswith("Parameter"):
                return False
    names = names_bound_by(statement)
    return member is None or member in names or not names
