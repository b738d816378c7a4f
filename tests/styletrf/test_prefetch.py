import threading
import time
from contextlib import closing
from itertools import count, islice

import pytest

from styletrf.prefetch import in_background, prefetch


def test_results_come_in_order_whatever_the_threads_do():
    def slow_first(k: int) -> int:
        time.sleep(0.02 if k % 3 == 0 else 0)
        return k * k

    results = list(prefetch(slow_first, range(20), threads=4, ahead=6))
    assert results == [k * k for k in range(20)]


def test_endless_items_are_read_no_further_than_ahead():
    taken = []

    def items():
        for k in count():
            taken.append(k)
            yield k

    with closing(prefetch(lambda k: k, items(), threads=2, ahead=3)) as results:
        assert list(islice(results, 5)) == [0, 1, 2, 3, 4]
    assert len(taken) <= 5 + 3


def test_an_exception_is_raised_in_its_turn():
    results = prefetch(lambda k: 1 // (2 - k), range(5), threads=2, ahead=4)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_closing_leaves_no_thread():
    before = threading.active_count()
    results = prefetch(lambda k: k, count(), threads=3, ahead=3)
    next(results)
    results.close()
    assert threading.active_count() == before


def test_prefetching_nothing_gives_no_results():
    assert list(prefetch(lambda k: k, [], threads=1, ahead=1)) == []


def test_items_taken_in_the_background_come_in_order_and_once():
    assert list(in_background(iter([3, None, 1, None]), ahead=2)) == [3, None, 1, None]


def test_items_are_taken_by_another_thread_before_they_are_needed():
    takers, second = [], threading.Event()

    def items():
        for k in range(2):
            takers.append(threading.get_ident())
            if k == 1:
                second.set()
            yield k

    with closing(in_background(items(), ahead=2)) as taken:
        next(taken)
        assert second.wait(10)
    assert threading.get_ident() not in takers


def test_an_exception_of_the_items_is_raised_after_those_before_it():
    taken = in_background((1 // (2 - k) for k in range(5)), ahead=3)
    assert [next(taken), next(taken)] == [0, 1]
    with pytest.raises(ZeroDivisionError):
        next(taken)


def test_nothing_ahead_is_refused_where_it_would_give_nothing():
    with pytest.raises(ValueError, match=r"\b0\b"):
        next(prefetch(lambda k: k, [1], threads=1, ahead=0))
