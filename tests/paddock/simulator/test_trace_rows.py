"""Rows of a trace as CSV text: each value as Python's own str writes it."""

from __future__ import annotations

import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paddock.simulator.trace import COLUMNS, PAUSE, STATUSES, Row, Trace, csv_rows

doubles = st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0]) | st.floats()


@given(st.lists(doubles))
def test_any_double_is_written_as_python_writes_it(values):
    column = np.array(values, np.float64)
    assert csv_rows([column]).decode().split() == [repr(value) for value in column.tolist()]


@given(st.lists(st.tuples(st.integers(-(2**63), 2**63 - 1), st.booleans(), st.sampled_from(STATUSES), doubles)))
def test_whole_numbers_truths_and_words(rows):
    wholes, truths, words, numbers = zip(*rows, strict=True) if rows else ((),) * 4
    columns = [np.array(wholes, "<i8"), np.array(truths, "|b1"), np.array(words, "<U12"), np.array(numbers, "<f8")]
    expected = "".join(",".join(map(str, row)) + "\n" for row in zip(wholes, truths, words, numbers, strict=True))
    assert csv_rows(columns).decode() == expected
    apart = np.array([one for number in numbers for one in (number, 0.0)], "<f8")[::2]  # not in one piece
    assert csv_rows([*columns[:3], apart]).decode() == expected


def test_equal_columns_and_equal_values_are_written_in_every_row():
    same, other = np.array([0.1, 0.1, 0.1]), np.array([0.0, -0.0, 0.0])
    assert csv_rows([same, other, same]) == b"0.1,0.0,0.1\n0.1,-0.0,0.1\n0.1,0.0,0.1\n"
    assert csv_rows([]) == b""


def test_a_trace_is_written_with_its_header():
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
    expected = [",".join(COLUMNS), *(",".join(str(value) for value in row) for row in rows)]
    assert Trace.of(rows).to_csv().decode() == "\n".join(expected) + "\n"
    assert Trace.of([]).to_csv().decode() == ",".join(COLUMNS) + "\n"
