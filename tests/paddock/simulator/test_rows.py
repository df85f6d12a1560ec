"""Rows as text: what C writes is what Python's own str and repr say, to the byte."""

from __future__ import annotations

import shutil
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paddock.simulator import compiled
from paddock.simulator.rows import written, written_slowly
from paddock.simulator.trace import COLUMNS, PAUSE, STATUSES, Row, Trace
from tests.soak import SOAK

needs_compiler = pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler")
MANY = 5_000_000 if SOAK else 50_000

doubles = st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0]) | st.floats()


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    """The library of the sources as they are now."""
    library = tmp_path_factory.mktemp("compiled") / compiled.LIBRARY.name
    compiled.build(library)
    return compiled.load(library)


def same(columns, in_c):
    return written(columns, in_c) == written_slowly(columns)


def column_of_bits(bits):
    return np.asarray(bits, np.uint64).view(np.float64)


@needs_compiler
@given(st.lists(doubles))
def test_any_double_is_written_as_python_writes_it(in_c, values):
    column = np.array(values, np.float64)
    assert written([column], in_c).decode().split() == [repr(value) for value in column.tolist()]


@needs_compiler
def test_doubles_where_digits_are_hard_to_find(in_c):
    edges = [
        exponent << 52 | fraction for exponent in range(2048) for fraction in (0, 1, 2, 2**51, 2**52 - 1, 2**52 - 2)
    ]
    edges += range(1, 2000)  # the smallest
    tens = np.array([float(f"{digits}e{power}") for power in range(-324, 309) for digits in (1, 5, 9.5, 1.7)])
    near = (tens.view(np.int64)[:, None] + np.arange(-2, 3)).ravel()
    whole = np.concatenate([2.0**53 + np.arange(-200, 200), np.arange(-1000, 1000) * 1e13, np.arange(3000) / 16.0])
    for column in (
        column_of_bits(edges),
        near.view(np.float64),
        whole,
        -whole,
        np.array([-0.0, np.inf, -np.inf, -np.nan]),
    ):
        assert same([column], in_c)


@needs_compiler
def test_many_doubles_of_each_kind_that_a_trace_has(in_c):
    rng = np.random.default_rng(5)
    kinds = (
        rng.uniform(-30.0, 30.0, MANY),
        rng.uniform(0.0, 100.0, MANY),
        np.arange(MANY) * (1000.0 / 15.0) / 1000.0,
        np.degrees(rng.uniform(-4.0, 4.0, MANY)),
        rng.normal(size=MANY) * 10.0 ** rng.integers(-20, 20, MANY),
        column_of_bits(rng.integers(0, 2**64, MANY, np.uint64)),
    )
    for column in kinds:
        assert same([column], in_c)


@needs_compiler
@given(st.lists(st.tuples(st.integers(-(2**63), 2**63 - 1), st.booleans(), st.sampled_from(STATUSES), doubles)))
def test_whole_numbers_truths_and_words(in_c, rows):
    wholes, truths, words, numbers = zip(*rows, strict=True) if rows else ((),) * 4
    columns = [np.array(wholes, "<i8"), np.array(truths, "|b1"), np.array(words, "<U12"), np.array(numbers, "<f8")]
    assert same(columns, in_c)
    assert same([column[::2] for column in columns], in_c)  # that do not lie in one piece


@needs_compiler
def test_what_c_does_not_know_python_writes(in_c):
    for column in (np.array(["größer", "a"]), np.array([1.5, 2.5], np.float32), np.array([1, 2], np.int32)):
        assert same([column], in_c)
    assert written([], in_c) == b""


def test_without_a_library_a_trace_is_the_same_file(monkeypatch):
    rows = [
        Row(
            0,
            n + 1.0,
            n / 3,
            -n / 7,
            1e-5 * n,
            -30.0,
            0.1,
            n,
            0.0,
            n > 1,
            True,
            n / 9,
            n,
            17.7,
            n / 15,
            PAUSE,
            0.0,
            0,
            0.0,
        )
        for n in range(4)
    ]
    trace = Trace.of(rows)
    expected = [",".join(COLUMNS), *(",".join(str(value) for value in row) for row in rows)]
    assert trace.to_csv().decode() == "\n".join(expected) + "\n"
    assert written([trace[name] for name in COLUMNS], None) == written([trace[name] for name in COLUMNS])
    assert Trace.of([]).to_csv().decode() == ",".join(COLUMNS) + "\n"
