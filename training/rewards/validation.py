"""Validates a reward function in the sandbox, in five states of a car on a real track."""

from __future__ import annotations

from dataclasses import dataclass, field

from paddock.errors import Param, UserFault

from .reasons import REWARD_WARNINGS
from .sandbox.client import ask
from .sandbox.function import name_state
from .sandbox.static_checks import MAX_CHARACTERS
from .trial_states import STATES, five_states

SYNTAX, IMPORT, TEST, WARNING = "syntax", "import", "test", "warning"
_TESTS = frozenset(
    {
        "reward_raised",
        "reward_param_unknown",
        "reward_not_a_number",
        "reward_not_finite",
        "reward_too_large",
        "reward_too_slow",
        "reward_memory",
        "reward_prints_too_much",
        "reward_stuck",
    }
)


@dataclass(frozen=True)
class Problem:
    """One problem. ``kind``: "syntax", "import", "test" (failed in a call) or "warning". ``code``: a reason code,
    ``params`` its details. ``line``: from 1, None if unknown. ``state``: one of :data:`.trial_states.STATES`, or
    None."""

    kind: str
    code: str
    line: int | None
    params: dict[str, Param] = field(default_factory=dict)
    state: str | None = None

    @property
    def fault(self) -> UserFault:
        return UserFault(self.code, **self.params)

    @classmethod
    def of(cls, fault: UserFault, state: str | None = None) -> Problem:
        line = fault.params.get("line")
        if fault.code in REWARD_WARNINGS:
            kind = WARNING
        elif fault.code in _TESTS:
            kind = TEST
        else:
            kind = IMPORT if fault.code.startswith("reward_import") else SYNTAX
        return cls(kind, fault.code, line if isinstance(line, int) else None, fault.params, state)


@dataclass(frozen=True)
class Report:
    """``problems``: none if the function may be trained with. ``rewards``: by the state's name, for those it survived.
    ``printed``: the beginning of the output. ``warnings``: do not prevent a training."""

    problems: list[Problem]
    rewards: dict[str, float]
    printed: str
    warnings: list[Problem] = field(default_factory=list)


def check_reward(code: str, *, race_type: str = "time_trial", level: int | None = None) -> Report:
    """Check the text, then call it in five states of a race of this type, 5 s of computing in all.

    Raises PlatformFault (``reward_check_failed``, and those of the sandbox).
    """
    if not 1 <= len(code) <= MAX_CHARACTERS:
        fault = UserFault("reward_length", length=len(code), limit=MAX_CHARACTERS)
        return Report([Problem.of(fault)], {}, "")
    states = five_states(race_type)
    answer = ask(code, states, check=True, whole=True, level=level)
    for fault, state in answer.faults:
        if state is not None:
            name_state(fault, states[state], STATES[state])
    problems = [Problem.of(fault, None if state is None else STATES[state]) for fault, state in answer.faults]
    rewards = {name: reward for name, reward in zip(STATES, answer.rewards, strict=False) if reward is not None}
    return Report(problems, rewards, answer.printed, [Problem.of(warning) for warning in answer.warnings])
