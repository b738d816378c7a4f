import itertools
import textwrap
import time

import pytest
from store_toys import Sentence

from pipeline.code.closure import code_closure, code_digest

counter = itertools.count()
STREET = ("Street.", "Street.__mro__", "Street.build")

FILES = {
    "__init__.py": "from {p}.colors import tint\n",
    "task.py": '''
        import luigi
        import {p}.geometry as geometry
        from {p} import scales
        from {p}.base import Base

        LIMIT = 3
        UNUSED = 4

        class Paint(Base):
            """Paints."""
            scene = luigi.Parameter(description="which")
            steps = 10

            def build(self, inputs, out, run):
                from {p} import tint
                tint(geometry.area(LIMIT), self.amount, scales.SCALE)

            @property
            def amount(self):
                return self.steps

            def requires(self):
                return {{"other": UNUSED}}
    ''',
    "base.py": """
        class Base:
            def helper(self):
                return 1

            def finish(self):
                return self.helper()
    """,
    "geometry.py": """
        from {p} import numbers_of
        UNITS = {{"m": 1}}
        UNITS["km"] = 1000

        def area(x):
            # a comment
            return numbers_of.square(x) * UNITS["m"]

        def volume(x):
            return x ** 3
    """,
    "numbers_of.py": '''
        from math import sqrt
        POWER = 2

        def square(x):
            """The square."""
            return _power(x)

        def _power(x):
            return sqrt(x ** POWER) ** 2
    ''',
    "colors.py": """
        class Palette:
            gamma = 2.2

        def tint(*values, palette=Palette):
            return values

        register = dict
        register(a=1)
    """,
    "scales.py": "SCALE = 1\nOTHER = 2\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A small project of seven modules, and a way to edit one of them."""
    name = f"toy_project_{next(counter)}"
    folder = tmp_path / name
    folder.mkdir()
    for file, text in FILES.items():
        (folder / file).write_text(textwrap.dedent(text.format(p=name)))
    monkeypatch.syspath_prepend(tmp_path)

    class Package:
        def digest(self):
            return code_digest(self.members())

        def members(self, class_name="Paint", module="task"):
            return code_closure(type(class_name, (), {"__module__": f"{name}.{module}"}))

        def edit(self, file, old, new):
            text = (folder / file).read_text()
            assert old in text
            (folder / file).write_text(text.replace(old, new))

    Package.name = name
    return Package()


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("task.py", "LIMIT = 3", "LIMIT = 30"),
        ("task.py", "steps = 10", "steps = 11"),
        ("task.py", "return self.steps", "return -self.steps"),
        ("task.py", "scales.SCALE", "scales.OTHER"),
        ("geometry.py", "* UNITS", "+ UNITS"),
        ("geometry.py", '["km"] = 1000', '["km"] = 1001'),
        ("numbers_of.py", "POWER = 2", "POWER = 4"),
        ("numbers_of.py", "** POWER", "* POWER"),
        ("numbers_of.py", "import sqrt", "import cbrt as sqrt"),
        ("colors.py", "gamma = 2.2", "gamma = 2.4"),
        ("colors.py", "register(a=1)", "register(a=2)"),
        ("scales.py", "SCALE = 1", "SCALE = 2"),
    ],
)
def test_an_edit_of_what_build_reaches_counts(package, file, old, new):
    before = package.digest()
    package.edit(file, old, new)
    assert package.digest() != before


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("task.py", '"""Paints."""', '"""Paints well."""'),
        ("task.py", 'description="which"', 'description="which scene", default="x"'),
        ("task.py", '{"other": UNUSED}', '{"another": UNUSED}'),
        ("task.py", "UNUSED = 4", "UNUSED = 5"),
        ("base.py", "return 1", "return 2"),
        ("geometry.py", "# a comment", "# another"),
        ("geometry.py", "x ** 3", "x ** 4"),
        ("numbers_of.py", '"""The square."""', ""),
        ("numbers_of.py", "return _power(x)", "return (\n        _power( x )\n    )"),
        ("scales.py", "OTHER = 2", "OTHER = 3"),
    ],
)
def test_an_edit_of_what_a_build_does_not_reach_keeps_the_digest(package, file, old, new):
    before = package.digest()
    package.edit(file, old, new)
    assert package.digest() == before


def test_methods_are_followed_into_bases_and_super(package):
    package.edit("task.py", "return self.steps", "return super().finish()")
    before = package.digest()
    package.edit("base.py", "return 1", "return 2")
    assert package.digest() != before


def test_a_module_used_as_an_object_counts_whole(package):
    package.edit("task.py", "scales.SCALE", "vars(scales)")
    before = package.digest()
    package.edit("scales.py", "OTHER = 2", "OTHER = 3")
    assert package.digest() != before


def test_a_module_named_by_a_string_counts_whole(package):
    package.edit("task.py", "scales.SCALE", f"__import__('{package.name}.scales')")
    before = package.digest()
    package.edit("scales.py", "OTHER = 2", "OTHER = 3")
    assert package.digest() != before


def test_all_of_a_property_and_what_hides_in_a_condition_count(package):
    setter = "@amount.setter\n    def amount(self, value):\n        self.x = 1\n\n"
    package.edit("task.py", "    def requires", f"    {setter}    def requires")
    package.edit("task.py", "    steps = 10", "    if True:\n        steps = 10")
    for old, new in (("self.x = 1", "self.x = 2"), ("steps = 10", "steps = 11")):
        before = package.digest()
        package.edit("task.py", old, new)
        assert package.digest() != before


def test_what_the_key_holds_by_value_is_not_followed(package):
    """A table that `identity_parameters` looks up in does not count, its outcome being keyed."""
    method = "def identity_parameters(self):\n        return {'amount': self.amount}\n\n    "
    package.edit("task.py", "def requires", f"{method}def requires")
    before = package.digest()
    package.edit("task.py", "steps = 10", "steps = 11")
    assert package.digest() == before
    package.edit("task.py", "{'amount': self.amount}", "{'amount': self.amount + 1}")
    assert package.digest() != before, "the amount itself is no longer in the key"


def test_self_given_away_takes_the_whole_class(package):
    package.edit("task.py", "return self.steps", "return repr(self)")
    before = package.digest()
    package.edit("base.py", "return 1", "return 2")
    assert package.digest() != before


def test_an_unknown_class_falls_back_to_its_module(package):
    found = package.members("NoSuchClass", "scales")
    assert {f"{package.name}.scales:SCALE", f"{package.name}.scales:OTHER"} <= set(found)


def test_a_digest_of_code_imports_none_of_it(package):
    import sys

    package.digest()
    assert not [name for name in sys.modules if name.startswith(package.name)]


def test_circular_imports_have_a_digest(package):
    package.edit(
        "colors.py", "class Palette", f"from {package.name} import tint as again\nclass Palette"
    )
    package.edit("colors.py", "return values", "return again(values)")
    assert package.digest()


def test_code_of_the_pipeline_is_not_in_the_code_of_a_task():
    found = code_closure(Sentence)
    assert {name.partition(":")[0] for name in found} == {"store_toys"}
    assert code_digest(found) == code_digest(dict(reversed(found.items())))


def test_the_digest_of_known_code_stays_as_it_was(tmp_path, monkeypatch):
    """Changes only with the scheme, deliberately, or with Python; it disowns every store."""
    (tmp_path / "golden_town.py").write_text(
        "SIZE = 2\nclass Street:\n    def build(self, inputs, out, run):\n        return SIZE\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    found = code_closure(type("Street", (), {"__module__": "golden_town"}))
    assert sorted(found) == [f"golden_town:{n}" for n in ("SIZE", *STREET)]
    assert code_digest(found) == "efe6189ab4d00145e9f2fa1878abf1a31394eeeb1087d34c933223259a2eedd3"


def test_the_code_of_the_project_is_read_in_a_second():
    """All of the library, read for the first time, in less than a second."""
    from pipeline.code import source

    source._parse.cache_clear()
    started = time.perf_counter()
    code_closure(type("NoSuchClass", (), {"__module__": "styletrf.geometry.cameras"}))
    assert time.perf_counter() - started < 1.0


def test_compiled_files_do_not_count_as_data_of_the_code(package, tmp_path):
    """What numba leaves below `__pycache__` is part of no code, even where a string names it."""
    package.edit("numbers_of.py", "POWER = 2", 'POWER = len("kernels") - 5')
    before = package.digest()
    folder = tmp_path / package.name / "__pycache__" / "kernels"
    folder.mkdir(parents=True)
    (folder / "square.nbi").write_bytes(b"compiled")
    assert package.digest() == before
