"""The parser of one command, and that of all."""

from __future__ import annotations

import argparse

import pytest

from paddock.cli.commands import parser


def commands(asked: str = "") -> dict[str, argparse.ArgumentParser]:
    (action,) = (one for one in parser(asked)._actions if isinstance(one, argparse._SubParsersAction))
    return dict(action.choices)


ALL = commands()


@pytest.mark.parametrize("name", ALL)
def test_a_command_alone_takes_the_same_arguments(name: str) -> None:
    alone = commands(name)
    assert list(alone) == [name] and alone[name].format_help() == ALL[name].format_help()


@pytest.mark.parametrize("asked", ["", "evalute", "--help", "list"])
def test_no_command_of_this_name_means_all(asked: str) -> None:
    assert list(commands(asked)) == list(ALL)
