"""A small project under edits: what is built again, why, and what a declaration spares."""

import json
import os
import re
import textwrap
from pathlib import Path

import pytest
from commands import finish, start
from message_words import mentions

from pipeline.code import adoption
from pipeline.code.adoption import with_adoption
from pipeline.code.snapshot import Snapshot

ROOT = Path(__file__).parents[3]
FILES = {
    "luigi.cfg": (ROOT / "luigi.cfg")
    .read_text()
    .replace("[store]\n", "[store]\nidentity = town.json\nexecutor = inline\n")
    .replace("pipeline/logging.cfg", str(ROOT / "pipeline/logging.cfg")),
    "town/__init__.py": "from town.houses import House, Street\n",
    "town/houses.py": """
        import luigi
        from pipeline.task import StoredTask

        class House(StoredTask):
            height = luigi.FloatParameter(default=2.5)
            plan = luigi.DictParameter(default={"rooms": 3, "roof": {"slope": 0.5}})

            def build(self, inputs, out, run):
                from town.bricks import wall
                (out / "house").write_text(wall(self.height))

        class Demand(House):
            name = luigi.Parameter()

        class Street(StoredTask):
            height = luigi.FloatParameter(default=2.5)
            user_errors = (LookupError,)

            def identity_parameters(self):
                return {}

            def requires(self):
                if not self.height:
                    raise LookupError("a street of height 0 has no houses")
                return {"house": House(self.height)}

            def build(self, inputs, out, run):
                from town.bricks import road
                (out / "street").write_text((inputs["house"] / "house").read_text() + road())
    """,
    "town/bricks.py": """
        SIZE = 2
        SURFACE = "tar"

        def wall(height):
            return _row() * int(height)

        def _row():
            return "#" * SIZE

        def road():
            return SURFACE
    """,
}


class Town:
    """The project in a folder, and its commands as a user types them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name, text in FILES.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(textwrap.dedent(text))

    def run(self, *arguments: str) -> tuple[int, str]:
        return finish(start(*arguments, cwd=self.folder))

    def built(self, *task: str) -> list[str]:
        """The families that Luigi builds for the task."""
        status, screen = self.run("luigi", "--module", "town", *(task or ("Street",)))
        assert status == 0, screen
        return sorted(re.findall(r"^(\w+).*: done", screen, re.MULTILINE))

    def why(self, *task: str) -> list[tuple[str, ...]]:
        """Family, state and difference in each row of the answer."""
        status, said = self.run("pipeline", "why", "--json", "--module", "town", *task)
        assert status == 0, said
        columns = ("task", "state", "what", "then", "now")
        return [tuple(row[name] for name in columns) for row in json.loads(said)]

    def edit(self, old: str, new: str, file: str = "town/bricks.py") -> None:
        path = self.folder / file
        text, before = path.read_text(), path.stat()
        assert old in text
        path.write_text(text.replace(old, new))
        # Python takes a file of the same second and size for the one that it compiled before.
        os.utime(path, (before.st_atime, before.st_mtime + 1))

    def snapshot(self) -> dict:
        return json.loads((self.folder / "town.json").read_text())


@pytest.fixture
def town(tmp_path: Path) -> Town:
    return Town(tmp_path)


def test_a_comment_builds_nothing_and_a_constant_what_depends_on_it(town: Town):
    assert town.built() == ["House", "Street"]
    town.edit("SIZE = 2", "SIZE = 2  # bricks\n")
    assert town.built() == []
    town.edit('"tar"', '"sand"')
    assert town.built() == ["Street"]


def test_edited_code_with_equal_bytes_builds_nothing_downstream(town: Town):
    """The upstream task has other code and the same bytes: nothing below it is built."""
    town.built()
    town.edit('"#" * SIZE', '"".join(["#"] * SIZE)')
    assert town.built() == ["House"]
    town.edit("SIZE = 2", "SIZE = 3")
    assert town.built() == ["House", "Street"]


def test_one_key_however_a_number_or_a_mapping_is_written(town: Town):
    plans = ('{"rooms": 3, "roof": {"slope": 1}}', '{"roof": {"slope": 1.0}, "rooms": 3.0}')
    assert town.built("House", "--height", "1", "--plan", plans[0]) == ["House"]
    assert town.built("House", "--height", "1.0", "--plan", plans[1]) == []
    assert town.built("House", "--height", "1e0", "--plan", plans[1]) == []
    assert town.built("House", "--height", "1.5", "--plan", plans[1]) == ["House"]


@pytest.mark.usefixtures("store")
def test_why_names_the_differences_of_each_stage(town: Town):
    assert town.why("Street") == [
        ("House", "the first of its family", "", None, None),
        ("Street", "waits for House", "", None, None),
    ]
    town.built()
    assert {state for _, state, *_ in town.why("Street")} == {"up to date"}
    plan = '{"rooms": 4, "roof": {"slope": 0.5}}'
    ((_, state, *difference),) = town.why("House", "--plan", plan)
    assert state.startswith("differs from ")
    assert difference == ["parameters.plan.rooms", 3, 4]
    town.edit("return _row() * int(height)", "return _line() * int(height)")
    town.edit("def _row():", "def _line():")
    rows = {what: (then is not None, now) for _, _, what, then, now in town.why("House")}
    assert set(rows) == {f"code.town.bricks:{name}" for name in ("wall", "_row", "_line")}
    assert rows["code.town.bricks:_row"][1] == "absent"


def test_why_names_the_input_and_its_maker(town: Town):
    town.built()
    assert town.built("House", "--height", "7") == ["House"]
    (_, (_, _, what, then, now)) = town.why("Street", "--height", "7")
    assert what == "inputs.house"
    assert then.endswith(" by House")
    assert now.endswith(" by House")
    assert then != now


def test_why_takes_the_nearest_and_of_equals_the_newest(town: Town):
    for height, rooms in ((1, 1), (2, 2), (3, 2)):
        town.built("House", "--height", str(height), "--plan", json.dumps({"rooms": rooms}))
    for rooms, nearest in ((1, 1), (2, 3)):
        ((*_, what, then, now),) = town.why(
            "House", "--height", "4", "--plan", json.dumps({"rooms": rooms})
        )
        assert (what, then, now) == ("parameters.height", nearest, 4)


def test_a_rename_that_is_adopted_builds_nothing(town: Town):
    town.built()
    assert town.run("pipeline", "snapshot", "--module", "town")[0] == 0
    for old, new in (("_row", "_line"), ("_line", "_course")):
        before = town.snapshot()["families"]["House"]
        town.edit(old, new)
        assert town.why("House")[0][1].startswith("differs from ")
        adopt = ("pipeline", "adopt", "--module", "town", "House", "--reason", "a rename")
        status, said = town.run(*adopt)
        assert status == 0, said
        assert town.built() == [], "declared to mean what the first meant"
        entry = town.snapshot()["adopted"][-1]
        assert {"from": before, "to": town.snapshot()["families"]["House"]}.items() <= entry.items()
        assert entry["reason"] == "a rename"
        status, said = town.run(*adopt)
        assert (status, mentions(said, "House"), said.count("\n")) == (2, True, 1)
    town.edit("SIZE = 2", "SIZE = 3")
    assert town.built() == ["House", "Street"]


def test_what_was_adopted_for_one_family_says_nothing_of_another(town: Town):
    one = with_adoption(Snapshot({"A": "1", "B": "1"}), "A", "2", "why not")
    assert (one.original("A", "2"), one.original("B", "2")) == ("1", "2")
    chain = with_adoption(one, "A", "3", "again")
    assert (chain.original("A", "3"), chain.original("A", "4")) == ("1", "4")
    back = with_adoption(chain, "A", "1", "back again")
    assert back.adopted == chain.adopted, "it means what it meant already"
    assert [back.original("A", code) for code in "123"] == ["1", "1", "1"]
    both = tuple({"family": "A", "from": a, "to": b} for a, b in ("12", "21"))
    circle = Snapshot({}, {}, both)
    assert circle.original("A", "1") in ("1", "2"), "two branches that were merged: it ends"


@pytest.mark.parametrize("text", ["", "[]", "{", '{"families": {}, "unheard of": 1}'])
def test_a_file_that_is_no_snapshot_is_one_line(town: Town, text: str):
    (town.folder / "town.json").write_text(text)
    status, said = town.run("pipeline", "snapshot", "--module", "town")
    assert status == 2
    assert mentions(said, "town.json", "git")
    assert said.count("\n") == 1


def test_the_snapshot_of_another_package_is_left_alone(town: Town):
    assert town.run("pipeline", "snapshot", "--module", "town")[0] == 0
    before = (town.folder / "town.json").read_text()
    (town.folder / "city").mkdir()
    (town.folder / "city/__init__.py").write_text(
        "from pipeline.task import StoredTask\n"
        "class Tower(StoredTask):\n    def build(self, inputs, out, run): pass\n"
    )
    for command in (["snapshot"], ["adopt", "Tower", "--reason", "none"]):
        status, said = town.run("pipeline", *command, "--module", "city")
        assert (status, said.count("\n")) == (2, 1)
        assert mentions(said, "town.json", "town", "city", "[store] identity")
    assert (town.folder / "town.json").read_text() == before


def test_a_refused_adoption_is_reported_with_what_to_do(town: Town):
    def adopt(family: str, reason: str = "a rename") -> str:
        words = ("adopt", "--module", "town", family, "--reason", reason)
        status, said = town.run("pipeline", *words)
        assert (status, said.count("\n")) == (2, 1)
        return said

    assert mentions(adopt("House"), "House", "`snapshot`")
    assert town.run("pipeline", "snapshot", "--module", "town")[0] == 0
    assert mentions(of_old_code := adopt("House"), "House")
    assert "`snapshot`" not in of_old_code
    assert mentions(adopt("Hose"), "town", "Hose", "Demand", "House", "Street")
    town.edit("SIZE = 2", "SIZE = 3")
    before = town.snapshot()
    assert mentions(adopt("House", " "), "--reason")
    assert town.snapshot() == before


@pytest.mark.parametrize("command", [["snapshot"], ["why"]])
def test_a_module_there_is_not_is_one_line(town: Town, command: list[str]):
    town.built()
    status, said = town.run("pipeline", *command, "--module", "nosuch")
    assert (status, mentions(said, "--module nosuch"), said.count("\n")) == (2, True, 1)


@pytest.mark.parametrize(
    ("task", "named"),
    [
        ((), ["TASK"]),
        (("Stret",), ["Stret", "Street"]),
        (("Demand",), ["Demand", "name"]),
        (("Street", "--until", "soon"), ["--until", "soon"]),
        (("Street", "--House-executor", "no"), ["--executor", "no", "subprocess"]),
        (("Street", "--height", "0"), ["a street of height 0"]),
    ],
)
def test_why_of_what_cannot_be_made_is_one_line(town: Town, task: tuple[str, ...], named: list):
    """It was a traceback, with the status of a problem that was found."""
    town.built()
    status, said = town.run("pipeline", "why", "--module", "town", *task)
    assert (status, mentions(said, *named), said.count("\n")) == (2, True, 1), said


def test_why_with_an_unknown_parameter_is_an_invalid_command(town: Town):
    town.built()
    status, said = town.run("pipeline", "why", "--module", "town", "Street", "--x", "1")
    assert (status, mentions(said, "--x"), "Traceback" in said) == (2, True, False)


def test_who_reads_the_snapshot_while_it_is_replaced_reads_the_former_one(tmp_path, monkeypatch):
    file = tmp_path / "identity.json"
    monkeypatch.setattr(adoption, "identity_file", lambda: file)
    adoption.write_snapshot(Snapshot({"A": "1"}))
    former = file.read_text()
    with file.open() as reader:
        adoption.write_snapshot(Snapshot({"A": "2"}))
        assert reader.read() == former
    assert json.loads(file.read_text())["families"] == {"A": "2"}
    assert [path.name for path in tmp_path.glob("*identity*")] == [file.name]


def test_the_members_of_a_code_are_kept_once_and_not_believed_when_damaged(store, tmp_path):
    from pipeline.code.closure import code_digest, load_closure, save_closure

    members = {"a:f": "1", "a:g": "2"}
    digest = save_closure(members, store)
    assert digest == code_digest(members)
    assert load_closure(digest, store) == members
    before = store.code(digest).stat().st_ino
    assert save_closure(members, store) == digest
    assert store.code(digest).stat().st_ino == before
    for damage in (b"", b"{", b'{"a:f":"1"}', b'{"@a": 1}', b"[]"):
        store.code(digest).write_bytes(damage)
        assert load_closure(digest, store) is None
    assert save_closure(members, store) == digest
    assert load_closure(digest, store) == members
