"""Projects P of a few files, and what in them the code of their task reaches.

The number 1001 stands where an edit must change the task's code, 2001 where it must not.
"""

REACHED = {
    "a function in a table": {
        "a.py": """
            def one(): return 1001
            def two(): return 2001
            TABLE = {"one": one}
            def value(task): return TABLE["one"]()
        """
    },
    "a table that another statement fills": {
        "a.py": """
            TABLE = {}
            def one(): return 1001
            TABLE["one"] = one
            def value(task): return TABLE["one"]()
        """
    },
    "a decorator, and its argument": {
        "a.py": """
            SIZE = 1001
            OTHER = 2001
            def cached(size): return lambda f: f
            @cached(SIZE)
            def value(task): return 1
        """
    },
    "what a decorator of the project registers": {
        "a.py": """
            from P.registry import REGISTRY
            import P.plugins
            def value(task): return REGISTRY["plugin"]()
        """,
        "registry.py": """
            REGISTRY = {}
            def register(f):
                REGISTRY[f.__name__] = f
                return f
        """,
        "plugins.py": """
            import functools
            from P.registry import register
            @register
            def plugin(): return 1001
            @functools.cache
            def other(): return 2001
        """,
    },
    "a case of a single-dispatch function": {
        "a.py": """
            import functools
            @functools.singledispatch
            def value(task): return 1
            @value.register(int)
            def _(task): return 1001
        """
    },
    "a dataclass's default and its factory": {
        "a.py": """
            from dataclasses import dataclass, field
            def ranks(): return [1001]
            @dataclass
            class Config:
                ranks: list = field(default_factory=ranks)
            def value(task): return Config()
        """
    },
    "a default argument": {
        "a.py": """
            SIZE = 1001
            def value(task, size=SIZE): return size
        """
    },
    "a class's body, and its base": {
        "a.py": """
            from P.b import Base
            class Value(Base):
                gamma = 1
            def value(task): return Value().curve()
        """,
        "b.py": """
            class Base:
                def curve(self): return 1001
        """,
    },
    "a class altered from outside": {
        "a.py": """
            class Value:
                gamma = 1
            Value.gamma = 1001
            def value(task): return Value.gamma
        """
    },
    "a table that another module fills": {
        "a.py": """
            import P.b
            from P.c import TABLE
            def value(task): return TABLE["one"]()
        """,
        "b.py": """
            from P.c import TABLE
            def one(): return 1001
            def two(): return 2001
            TABLE["one"] = one
        """,
        "c.py": "TABLE = {}",
    },
    "a table that another module adds to in place": {
        "a.py": """
            import P.b
            from P.c import TABLE
            def value(task): return TABLE[0]()
        """,
        "b.py": """
            from P.c import TABLE
            def one(): return 1001
            TABLE += [one]
        """,
        "c.py": "TABLE = []",
    },
    "a constant that another module sets": {
        "a.py": """
            import P.b
            from P import c
            def value(task): return c.GAIN
        """,
        "b.py": """
            from P import c
            c.GAIN = 1001
            other = 2001
        """,
        "c.py": "GAIN = 1",
    },
    "a function that another module puts in": {
        "a.py": """
            import P.b
            from P import c
            def value(task): return c.late()
        """,
        "b.py": """
            from P import c
            def patched(): return 1001
            c.late = patched
        """,
        "c.py": "",
    },
    "a constant made by a Parameter that is not Luigi's": {
        "a.py": """
            from torch import nn
            WEIGHT = nn.Parameter(1001)
            def value(task): return WEIGHT
        """
    },
    "a constant made by a function called like a parameter": {
        "a.py": """
            def MakeParameter(x): return x
            SIZE = MakeParameter(1001)
            def value(task): return SIZE
        """
    },
    "a member of the task that is no parameter of Luigi's": {
        "task.py": """
            import luigi as l
            from torch import nn
            class Task:
                scene = l.Parameter(description=2001)
                weight = nn.Parameter(1001)
                def build(self, inputs, out, run): print(self.scene, self.weight)
        """
    },
    "a module imported by importlib under its name": {
        "a.py": """
            from importlib import import_module as load
            def value(task): return load("P.b").one()
        """,
        "b.py": "def one(): return 1001",
    },
    "a star import": {
        "a.py": """
            from P.b import *
            def value(task): return one()
        """,
        "b.py": "def one(): return 1001",
    },
    "a name re-exported by a star import": {
        "a.py": """
            from P.b import one
            def value(task): return one()
        """,
        "b.py": "from P.c import *",
        "c.py": "def one(): return 1001",
    },
    "the second choice of a tried import": {
        "a.py": """
            try:
                from P.missing import one
            except ImportError:
                from P.b import one
            def value(task): return one()
        """,
        "b.py": "def one(): return 1001",
    },
    "the first choice of a tried import": {
        "a.py": """
            try:
                from P.b import one
            except ImportError:
                from P.c import one
            def value(task): return one()
        """,
        "b.py": "def one(): return 1001",
        "c.py": "def one(): return 3",
    },
    "an import that is wrapped under its own name": {
        "a.py": """
            from P.b import one
            one = print or one
            def value(task): return one()
        """,
        "b.py": "def one(): return 1001",
    },
    "what stands in a condition": {
        "a.py": """
            if True:
                SIZE = 1001
            def value(task): return SIZE
        """
    },
    "a walrus": {
        "a.py": """
            SIZES = [(SIZE := 1001), 2]
            def value(task): return SIZE
        """
    },
    "an import inside a function, of another name": {
        "a.py": """
            def value(task):
                from P import b as c
                return c.one()
        """,
        "b.py": """
            def one(): return 1001
            def two(): return 2001
        """,
    },
    "a relative import": {
        "a.py": """
            def value(task):
                from .b import one
                return one()
        """,
        "b.py": "def one(): return 1001",
    },
    "getattr on a module": {
        "a.py": """
            from P import b
            def value(task): return getattr(b, task.name)()
        """,
        "b.py": "def one(): return 1001",
    },
    "getattr on the task": {
        "task.py": """
            class Task:
                def one(self): return 1001
                def build(self, inputs, out, run):
                    getattr(self, "o" + "ne")()
        """
    },
    "a module named in a command line": {
        "a.py": """
            def value(task): return ["python", "-m", "P.b"]
        """,
        "b.py": "print(1001)",
    },
    "what a module does when it is imported": {
        "a.py": """
            import P.b
            def value(task): return 1
        """,
        "b.py": """
            import warnings
            warnings.simplefilter("ignore", lineno=1001)
            def other(): return 2001
        """,
    },
    "what a package does when a module in it is imported": {
        "__init__.py": "print(1001)",
        "a.py": "def value(task): return 1",
    },
    "a file of the package": {
        "a.py": """
            from pathlib import Path
            TEMPLATE = Path(__file__).with_name("page.html")
            def value(task): return TEMPLATE.read_text()
        """,
        "page.html": "1001",
        "other.html": "2001",
    },
    "a file found through importlib": {
        "a.py": """
            from importlib import resources
            def value(task): return resources.files("P") / "tables" / "one.json"
        """,
        "tables/one.json": "1001",
        "other.json": "2001",
    },
    "all files of a folder": {
        "a.py": """
            from pathlib import Path
            def value(task): return list((Path(__file__).parent / "tables").glob("*"))
        """,
        "tables/one.json": "1001",
        "other.json": "2001",
    },
    "what a value in the key does, beside what it is": {
        "task.py": """
            from P.b import Config
            class Task:
                @property
                def config(self): return Config(1)
                def identity_parameters(self): return {"config": self.config}
                def build(self, inputs, out, run): self.config.write(out)
        """,
        "b.py": """
            class Config:
                def write(self, out): return 1001
        """,
    },
    "a decorator of the task's class": {
        "task.py": """
            from P.b import seeded
            @seeded(7)
            class Task:
                def build(self, inputs, out, run): pass
        """,
        "b.py": "def seeded(seed): return lambda task: 1001",
    },
    "a member set from outside the task's class": {
        "task.py": """
            class Task:
                def build(self, inputs, out, run): print(self.steps)
            Task.steps = 1001
        """
    },
    "a method of a mixin": {
        "task.py": """
            from P.b import Mixin
            class Base:
                unused = 2001
            class Task(Mixin, Base):
                def build(self, inputs, out, run): super().finish()
        """,
        "b.py": """
            class Mixin:
                def finish(self): return self.more()
                def more(self): return 1001
        """,
    },
}
