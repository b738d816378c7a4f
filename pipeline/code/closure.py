"""The identity of a task's code: everything in the project that its `build` can reach.

Names are followed statically, function by function, across the modules of the project. The modules
are not imported, since they load torch. Comments, formatting and docstrings do not count. A file of
the package counts for the code that names it. If a name is ambiguous, more is included than needed:
a module used as an object counts as a whole, and the statements that run on import count for every
importer. Code that cannot be followed is refused. Values that the key contains are not followed:
parameters, and `self.x` in the result of `identity_parameters`. `pipeline` itself is excluded: a
change there that alters artifacts changes a tag in `record`.
"""

import ast
import contextlib
import functools
import itertools
import json
import re
from collections.abc import Iterator, Mapping

from pipeline.canonical import canonical_json
from pipeline.code.closure_cache import cached_closure
from pipeline.code.source import (
    Imports,
    Piece,
    Source,
    Symbol,
    data_files,
    dotted_names,
    piece,
    read,
)
from pipeline.digest import file_digest, typed_digest
from pipeline.errors import StoreError
from pipeline.store import Store

PROJECT = {"styletrf", "tasks"}
IDENTITY = "identity_parameters"
_UNTRACEABLE = re.compile(
    r"(?:id|attr|name|arg)='(?:__doc__|__subclasses__|__init_subclass__|metaclass)'"
)
"""In the text of `ast.dump`: names of code that uses more than its text shows."""
_DYNAMIC_EXECUTION = re.compile(r"((builtins\.)?(eval|exec|globals)|sys\.modules|runpy)(\.|$)")
"""The same for names, as written and as resolved."""
_IMPORTERS = {"__import__", ("builtins", "__import__"), ("importlib", "import_module")}
_FILE_LOOKUP = re.compile(r"__(file|path|spec|package)__|importlib\.resources|pkgutil")
_MODULE = re.compile(r"\w+(\.\w+)+")
_OWN = re.compile(r"self\.(\w+)(\(\))?")
_OUTSIDE = Source("", {}, {}, {})


def code_digest(members: Mapping[str, str]) -> str:
    """Returns the digest of the result of `code_closure`."""
    return typed_digest("pipeline-code-v2", canonical_json(members))


def code_closure(task_class: type) -> dict[str, str]:
    """Returns the digests of all code that the class's `build` reaches now, by name.

    Raises:
        StoreError: The code uses something that cannot be followed, such as `eval`.
    """
    module, name = task_class.__module__, task_class.__qualname__
    follow = functools.partial(follow_closure, module, name)
    if module.split(".")[0] not in PROJECT:
        return follow()
    return cached_closure(f"{module}:{name}", PROJECT, follow)


def follow_closure(module: str, class_name: str) -> dict[str, str]:
    """Returns the result of `code_closure` for a class by its name, without the cache."""
    walk = _Walk(module, class_name)
    while walk.pending:
        walk.visit(walk.pending.pop())
    return walk.found


def save_closure(members: Mapping[str, str], store: Store) -> str:
    """Writes the result of `code_closure` into the store, if it is absent; returns its digest."""
    digest = code_digest(members)
    if load_closure(digest, store) is None:
        store.code(digest).parent.mkdir(exist_ok=True)
        store.code(digest).write_bytes(canonical_json(members))
    return digest


def load_closure(digest: str, store: Store) -> dict[str, str] | None:
    """Reads what `save_closure` wrote under the digest; None if it is absent or damaged."""
    with contextlib.suppress(OSError):
        return closure_from_json(store.code(digest).read_bytes(), digest)
    return None


def closure_from_json(text: bytes, digest: str) -> dict[str, str] | None:
    """Reads the result of `code_closure` with this digest; None if the text is anything else."""
    with contextlib.suppress(ValueError, TypeError, RecursionError):
        members: dict[str, str] = json.loads(text)
        return members if code_digest(members) == digest else None
    return None


class _Walk:
    """The search from one task's class; `found` has the result, `pending` the symbols to visit.

    A symbol of one part is a module used as an object. A symbol of two parts is a top-level name,
    or "" for the statements that run on import. A symbol of three parts is a member of the task's
    class or of a base.
    """

    def __init__(self, module: str, class_name: str) -> None:
        self.task = f"{module}:{class_name}"
        self.roots = {module.split(".")[0], *PROJECT} - {"pipeline"}
        self.files = {name: file for root in self.roots for name, file in data_files(root).items()}
        ours = self.roots.__contains__
        self.source = functools.cache(lambda m: (ours(m.split(".")[0]) and read(m)) or _OUTSIDE)
        self.classes = list(self._lineage(module, class_name))
        self.by_value = self._keyed_by_value()
        self.found = {f"{self.task}.__mro__": code_digest({"": str(self.classes)})}
        self.pending = [*self._members("build")] or [(module,)]  # a class made inside a function
        self._seen: set[Symbol] = set()

    def visit(self, symbol: Symbol) -> None:
        """Records a piece of code with the meanings of its names, and queues these meanings."""
        module, *names = symbol
        source = self.source(module)
        if source is _OUTSIDE or symbol in self._seen:
            return
        self._seen.add(symbol)
        code = piece(source, *names)
        local, paths = code.imports, set(code.names)
        if not names:
            paths = {(name,) for name in (*source.bindings, *source.imports)}
        meanings = {".".join(path): self._resolve(module, path, local) for path in paths}
        self.pending += itertools.chain(*meanings.values())
        self.pending += self._run_by(module, source.imports if names == [""] else local)
        self.pending += self._registered(module) if names == [""] else ()
        for path in paths - self.by_value if names[1:] else ():
            if path[0] in ("self", "cls"):
                self.pending += self._members(*path[1:2])
        if code.text:
            self._note(f"{module}:{'.'.join(names)}", code, meanings)

    def _note(self, name: str, code: Piece, meanings: Mapping[str, list[Symbol]]) -> None:
        """Adds a piece of code to `found`, with the files of the project that it names."""
        for string in filter(_MODULE.fullmatch, code.strings):
            self.pending += self._locate(tuple(string.split(".")))
        files = [file for file in self.files if any(f"/{s}/" in f"{file}/" for s in code.strings)]
        words = {*meanings, *(".".join(symbol) for each in meanings.values() for symbol in each)}
        hiding = [
            *_UNTRACEABLE.findall(code.text),
            *sorted(filter(_DYNAMIC_EXECUTION.match, words)),
            *_computed_imports(code, meanings),
            *filter(_FILE_LOOKUP.match, () if files else words),
        ]
        if hiding:
            raise StoreError(
                f"{self.task}: its build reaches {name}, where {hiding[0]} hides the code it uses."
                " Name this code directly, or give the task a `revision`."
            )
        self.found[name] = typed_digest(
            "pipeline-code-v2", code.text.encode(), canonical_json(meanings)
        )
        self.found |= {file: file_digest(self.files[file]) for file in files}

    def _members(self, member: str = "") -> Iterator[Symbol]:
        """Yields a member of the task's class and its bases; all members if none is named."""
        for module, name in self.classes:
            every = self.source(module).members[name]
            for each in {member, ""} if member else every:
                yield module, name, each

    def _keyed_by_value(self) -> set[Symbol]:
        """Returns the names whose values are in the key, as in `{"config": self.config}`."""
        keyed: set[Symbol] = {("self", IDENTITY)}
        for module, name in self.classes:
            for method in self.source(module).members[name].get(IDENTITY, []):
                match [part.value for part in ast.walk(method) if isinstance(part, ast.Return)]:
                    case [ast.Dict(values=values)]:
                        owned = (_OWN.fullmatch(ast.unparse(value)) for value in values)
                        keyed |= {("self", own[1]) for own in owned if own}
                if "super()" not in ast.unparse(method):
                    return keyed
        return keyed

    def _run_by(self, module: str, imports: Imports) -> Iterator[Symbol]:
        """Yields the statements that run when a module, and its imports, are imported."""
        yield from ((module, ""), (module.rpartition(".")[0], ""))
        for target in itertools.chain(*imports.values()):
            yield from ((target[0], ""), (".".join(target), ""))
            yield from [target[:1]] if target[-1] == "*" else []

    def _registered(self, module: str) -> Iterator[Symbol]:
        """Yields the definitions to which the module applies a decorator of the project."""
        for name, statements in self.source(module).bindings.items():
            marks = [mark for part in statements for mark in getattr(part, "decorator_list", [])]
            paths = [path for mark in marks for path in dotted_names(getattr(mark, "func", mark))]
            meant = [symbol for path in paths for symbol in self._resolve(module, path, {})]
            if any(self.source(symbol[0]) is not _OUTSIDE for symbol in meant):
                yield module, name

    def _lineage(self, module: str, name: str) -> Iterator[Symbol]:
        """Yields the class and its bases in the project, nearest first."""
        source = self.source(module)
        if name in source.members:
            yield module, name
            bases = [base for part in source.bindings[name] for base in getattr(part, "bases", [])]
            for path in (path for base in bases for path in dotted_names(base)):
                for symbol in self._resolve(module, path, {}):
                    yield from self._lineage(symbol[0], symbol[-1])

    def _resolve(self, module: str, path: Symbol, local: Imports) -> list[Symbol]:
        """Returns the definitions of a dotted path as read in `module`; empty for a local name."""
        source, head = self.source(module), path[0]
        is_known = head in source.bindings or head in source.imports
        targets = [(*target, *path[1:]) for target in local.get(head, [])]
        targets = targets or [(module, *path)] * is_known
        return [symbol for target in targets for symbol in self._locate(target)]

    def _locate(self, symbol: Symbol) -> list[Symbol]:
        """Returns the definitions of a dotted name, through submodules and re-exports.

        A name outside the project stays as it is.
        """
        module, *names = symbol
        source = self.source(module)
        if source is _OUTSIDE or not names:
            return [symbol]
        found: list[Symbol] = [(module, names[0])] if names[0] in source.bindings else []
        targets = [t for t in source.imports.get(names[0], []) if t != (module, names[0])]
        inner = f"{module}.{names[0]}"
        if not found and not targets and self.source(inner) is not _OUTSIDE:
            targets = [(inner,)]
        found += [s for target in targets for s in self._locate((*target, *names[1:]))]
        return found or [(module,)]


def _computed_imports(code: Piece, meanings: Mapping[str, list[Symbol]]) -> list[str]:
    """Returns the uses of import functions whose module name is not a constant."""
    importers = {path for path, symbols in meanings.items() if _IMPORTERS & {path, *symbols}}
    uses = [path for path in map(".".join, code.names) if path in importers]
    for called in filter(importers.__contains__, code.calls_with_constant):
        uses.remove(called)
    return uses
