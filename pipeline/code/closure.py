"""The identity of a task's code: everything in the project that its `build` can reach.

Names are followed statically, function by function, across the modules of the project, without
importing them (they load torch). Comments, formatting and docstrings do not count; a file of the
package counts for the code that names it. Where a name is ambiguous, more is taken than
needed: a module used as an object counts whole, and what a module does when it is imported counts
for all who import it. What cannot be followed at all is refused. Not followed is what the key
holds by value: parameters, and `self.x` in `identity_parameters`' result. `pipeline` itself is
left out: a change there that alters artifacts changes a tag in `record`.
"""

import ast
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
"""In a syntax tree as `ast.dump` writes it: what uses more than its text names."""
_DYNAMIC_EXECUTION = re.compile(r"((builtins\.)?(eval|exec|globals)|sys\.modules|runpy)(\.|$)")
"""The same among names, as written and as what they mean."""
_IMPORTERS = {"__import__", ("builtins", "__import__"), ("importlib", "import_module")}
_FILE_LOOKUP = re.compile(r"__(file|path|spec|package)__|importlib\.resources|pkgutil")
_MODULE = re.compile(r"\w+(\.\w+)+")
_OWN = re.compile(r"self\.(\w+)(\(\))?")
_OUTSIDE = Source("", {}, {}, {})


def code_digest(members: Mapping[str, str]) -> str:
    """The digest of all that `code_closure` found."""
    return typed_digest("pipeline-code-v2", canonical_json(members))


def code_closure(task_class: type) -> dict[str, str]:
    """What the class's `build` depends on, as the files are now: digests of code by its name.

    Raises:
        StoreError: When it reaches what cannot be followed, such as `eval`.
    """
    module, name = task_class.__module__, task_class.__qualname__
    follow = functools.partial(_followed, module, name)
    if module.split(".")[0] not in PROJECT:
        return follow()
    return cached_closure(f"{module}:{name}", PROJECT, follow)


def _followed(module: str, class_name: str) -> dict[str, str]:
    walk = _Walk(module, class_name)
    while walk.pending:
        walk.visit(walk.pending.pop())
    return walk.found


def save_closure(members: Mapping[str, str], store: Store) -> str:
    """Writes what `code_closure` found into the store, unless it is there; returns its digest."""
    digest = code_digest(members)
    if load_closure(digest, store) is None:
        store.code(digest).parent.mkdir(exist_ok=True)
        store.code(digest).write_bytes(canonical_json(members))
    return digest


def load_closure(digest: str, store: Store) -> dict[str, str] | None:
    """What `save_closure` wrote under the digest; None if it is absent or damaged."""
    try:
        members: dict[str, str] = json.loads(store.code(digest).read_bytes())
    except (OSError, ValueError):
        return None
    return members if code_digest(members) == digest else None


class _Walk:
    """From one task's class outwards; `found` is the result, `pending` what is still to read.

    A symbol of one part is a module used as an object; of two, a top-level name, or "" for what
    runs when the module is imported; of three, a member of the task's class or of a base.
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
        """Note what a piece of code says and what its names mean; go on to what they mean."""
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
        """Put a piece of code among the found, with the files of the project that it names."""
        for string in filter(_MODULE.fullmatch, code.strings):
            self.pending += self._locate(tuple(string.split(".")))
        files = [file for file in self.files if any(f"/{s}/" in f"{file}/" for s in code.strings)]
        words = {*meanings, *(".".join(symbol) for each in meanings.values() for symbol in each)}
        hiding = [
            *_UNTRACEABLE.findall(code.text),
            *sorted(filter(_DYNAMIC_EXECUTION.match, words)),
        ]
        hiding += [
            *_computed_imports(code, meanings),
            *filter(_FILE_LOOKUP.match, () if files else words),
        ]
        if hiding:
            raise StoreError(
                f"{self.task}: its build reaches {name}, where {hiding[0]} hides what is used."
                " Name that in the code, or give the task a `revision`."
            )
        self.found[name] = typed_digest(
            "pipeline-code-v2", code.text.encode(), canonical_json(meanings)
        )
        self.found |= {file: file_digest(self.files[file]) for file in files}

    def _members(self, member: str = "") -> Iterator[Symbol]:
        """A method or constant of the task's class and its bases; without a name, all of them."""
        for module, name in self.classes:
            every = self.source(module).members[name]
            for each in {member, ""} if member else every:
                yield module, name, each

    def _keyed_by_value(self) -> set[Symbol]:
        """The names whose values `identity_parameters` returns: `{"config": self.config}`."""
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
        """What runs because a module, and what it imports, is imported."""
        yield from ((module, ""), (module.rpartition(".")[0], ""))
        for target in itertools.chain(*imports.values()):
            yield from ((target[0], ""), (".".join(target), ""))
            yield from [target[:1]] if target[-1] == "*" else []

    def _registered(self, module: str) -> Iterator[Symbol]:
        """The definitions that a decorator of the project sees when the module is imported."""
        for name, statements in self.source(module).bindings.items():
            marks = [mark for part in statements for mark in getattr(part, "decorator_list", [])]
            paths = [path for mark in marks for path in dotted_names(getattr(mark, "func", mark))]
            meant = [symbol for path in paths for symbol in self._resolve(module, path, {})]
            if any(self.source(symbol[0]) is not _OUTSIDE for symbol in meant):
                yield module, name

    def _lineage(self, module: str, name: str) -> Iterator[Symbol]:
        """The class and its bases in the project, nearest first."""
        source = self.source(module)
        if name in source.members:
            yield module, name
            bases = [base for part in source.bindings[name] for base in getattr(part, "bases", [])]
            for path in (path for base in bases for path in dotted_names(base)):
                for symbol in self._resolve(module, path, {}):
                    yield from self._lineage(symbol[0], symbol[-1])

    def _resolve(self, module: str, path: Symbol, local: Imports) -> list[Symbol]:
        """Where the dotted path, as read in `module`, is defined; nowhere for a local name."""
        source, head = self.source(module), path[0]
        is_known = head in source.bindings or head in source.imports
        targets = [(*target, *path[1:]) for target in local.get(head, [])]
        targets = targets or [(module, *path)] * is_known
        return [symbol for target in targets for symbol in self._locate(target)]

    def _locate(self, symbol: Symbol) -> list[Symbol]:
        """Where a dotted name is defined, through submodules and re-exports; outside, as it is."""
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
    """Uses of what imports by name, however called here, other than for a name in the text."""
    importers = {path for path, symbols in meanings.items() if _IMPORTERS & {path, *symbols}}
    uses = [path for path in map(".".join, code.names) if path in importers]
    for called in filter(importers.__contains__, code.calls_with_constant):
        uses.remove(called)
    return uses
