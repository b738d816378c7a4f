"""The order and the extent of the graph of a task."""

import luigi
import pytest
from hypothesis import given
from hypothesis import strategies as st
from store_toys import Sentence, Word

from pipeline.maintenance.task_graph import stored_tasks, upstream_first


class Numbered(luigi.Task):
    """Needs the tasks with the given numbers, which are below its own."""

    number = luigi.IntParameter()
    needs = luigi.DictParameter()

    def requires(self):
        return [Numbered(number=n, needs=self.needs) for n in self.needs.get(str(self.number), [])]


class Both(luigi.WrapperTask):
    """A task without an artifact, which needs one with."""

    def requires(self):
        return [Sentence()]


@st.composite
def roots(draw):
    count = draw(st.integers(1, 7))
    needs = {str(n): draw(st.lists(st.integers(0, n - 1), max_size=3)) for n in range(1, count)}
    return Numbered(number=count - 1, needs=needs)


def reached(task):
    return {task}.union(*(reached(upstream) for upstream in task.requires()))


@given(roots())
def test_each_task_comes_once_and_after_what_it_needs(root):
    order = list(upstream_first(root))
    assert set(order) == reached(root)
    assert len(order) == len(set(order))
    for place, task in enumerate(order):
        assert set(task.requires()) <= set(order[:place])


@given(roots())
def test_graphs_of_several_roots_share_their_tasks(root):
    upstream = root.requires()
    assert list(upstream_first(*upstream, root)) == list(upstream_first(root))


@given(roots(), st.sets(st.integers(0, 6)))
def test_nothing_comes_that_only_left_out_tasks_need(root, left_out):
    asked = []

    def is_left_out(task):
        asked.append(task)
        return task.number in left_out

    def kept(task):
        if task.number in left_out:
            return set()
        return {task}.union(*(kept(upstream) for upstream in task.requires()))

    assert set(upstream_first(root, is_left_out=is_left_out)) == kept(root)
    assert len(asked) == len(set(asked))


@pytest.mark.parametrize("count", [0, 1])
def test_a_graph_without_needs_is_its_roots(count):
    roots = [Numbered(number=n, needs={}) for n in range(count)]
    assert list(upstream_first(*roots)) == roots


def test_stored_tasks_are_those_with_artifacts_in_the_order_of_the_graph():
    hello, world, sentence = Word("hello"), Word("world"), Sentence()
    assert list(stored_tasks(Both())) == [hello, world, sentence]
    assert list(stored_tasks(Both(), is_left_out=lambda t: t == hello)) == [world, sentence]


@given(roots())
def test_a_graph_without_artifacts_has_no_stored_tasks(root):
    assert not list(stored_tasks(root, is_left_out=lambda _: pytest.fail("it has an artifact")))
