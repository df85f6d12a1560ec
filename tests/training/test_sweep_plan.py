"""Which trial of a sweep trains next, for how long, and with which setting."""

from __future__ import annotations

import pytest

from paddock.errors import UserFault
from training.jobs.settings_checks import DEFAULT_ACTIONS, DEFAULT_BOUNDS
from training.sweeps.halving import Begin, Continue, TrialFacts, next_move, plan, rungs_of
from training.sweeps.space import check_size, checked_space, combinations, least_budget_s

study = pytest.importorskip("training.sweeps.study", reason="training is not installed: make training")

TABLE = {"action_space_type": "discrete", "action_space": [dict(one) for one in DEFAULT_ACTIONS]}
RANGES = {"action_space_type": "continuous", "action_space": DEFAULT_BOUNDS}
SPACE = {
    "hyperparameters": {"lr": {"low": 1e-5, "high": 1e-3}, "batch_size": {"choices": [32, 64, 128]}},
    "action_spaces": [TABLE, RANGES],
    "reward_functions": ["a"],
}


def a_space(**changes):
    return checked_space(algorithm="ppo", base=TABLE, reward_code="a", **{"hyperparameters": {}} | changes)


def run(settings: int, budget_s: float, score) -> tuple[list[TrialFacts], list]:
    """A sweep to its end, each trial with ``score(index)`` for every rung and None for a failure."""
    trials: list[TrialFacts] = []
    moves = []
    while (move := next_move(settings, budget_s, trials, study.continuing)) is not None:
        moves.append(move)
        if isinstance(move, Begin):
            trials.append(TrialFacts())
        index = move.index if isinstance(move, Continue) else len(trials) - 1
        until = move.until_s if isinstance(move, Continue) else move.seconds
        reached = score(index)
        before = trials[index].results
        trials[index] = (
            TrialFacts(before, failed=True, seconds=until / 2)
            if reached is None
            else TrialFacts((*before, (reached, until)))
        )
        assert len(moves) < 50
    return trials, moves


@pytest.mark.parametrize(
    ("settings", "sizes"), [(2, [2, 1]), (3, [3, 1]), (4, [4, 1]), (6, [6, 2, 1]), (9, [9, 3, 1]), (12, [12, 4, 1])]
)
def test_a_third_of_each_rung_continues(settings, sizes):
    assert rungs_of(settings) == sizes


@pytest.mark.parametrize("settings", range(2, 13))
def test_all_rungs_together_use_the_budget(settings):
    trials, moves = run(settings, 600.0, lambda index: float(index))
    assert sum(one.results[-1][1] for one in trials) == pytest.approx(600.0)
    assert [isinstance(one, Begin) for one in moves[:settings]] == [True] * settings
    assert moves[-1].last and moves[-1].index == settings - 1, "the best is in the last rung"
    assert [len(one.results) for one in trials].count(1) == settings - plan(settings, 600.0)[1].trials


def test_of_equal_trials_the_earlier_continues():
    _, moves = run(6, 60.0, lambda index: 0.0)
    assert [one.index for one in moves if isinstance(one, Continue)] == [0, 1, 0]


def test_the_time_of_a_failed_trial_goes_to_the_others():
    trials, _ = run(3, 60.0, lambda index: None if index == 2 else float(index))
    assert [len(one.results) for one in trials] == [1, 2, 0]
    assert trials[1].results[-1][1] == pytest.approx(10.0 + 60.0 - 25.0)


def test_a_sweep_whose_trials_all_fail_is_over():
    trials, moves = run(4, 60.0, lambda index: None)
    assert (len(trials), len(moves)) == (4, 4)


def test_the_pruner_keeps_the_best_third():
    assert study.continuing([5.0, 9.0, 1.0, 7.0, 8.0, 2.0]) == [1, 4]
    assert study.continuing([5.0]) == [0]
    assert study.continuing([3.0, 4.0]) == [1]


def test_a_suggested_setting_is_new_within_the_space_and_repeatable():
    known = []
    for number in range(11):
        setting = study.suggest(SPACE, known, seed=7)
        assert setting == study.suggest(SPACE, known, seed=7)
        assert 1e-5 <= setting["hyperparameters"]["lr"] <= 1e-3
        assert setting["hyperparameters"]["batch_size"] in (32, 64, 128)
        assert (setting["action_space"] in (0, 1), setting["reward_function"]) == (True, 0)
        assert setting not in [one for one, _ in known]
        known.append((setting, None if number == 3 else float(number)))


def test_a_small_space_is_tried_in_full():
    space = {"hyperparameters": {}, "action_spaces": [TABLE, RANGES], "reward_functions": ["a", "b", "c"]}
    known = []
    for number in range(6):
        known.append((study.suggest(space, known, seed=1), float(number)))
    assert len({(one["action_space"], one["reward_function"]) for one, _ in known}) == 6


def test_base_settings_outside_of_the_ranges_are_no_obstacle():
    base = {"hyperparameters": {"lr": 1e-7, "batch_size": 64}, "action_space": 0, "reward_function": 0}
    assert study.suggest(SPACE, [(base, 3.0)], seed=1)["hyperparameters"]["lr"] >= 1e-5


def test_suggestions_turn_to_what_did_well():
    """Eight trials of which small learning rates did better: the next ones are small, too."""
    space = {
        "hyperparameters": {"lr": {"low": 1e-5, "high": 1e-3}},
        "action_spaces": [TABLE],
        "reward_functions": ["a"],
    }
    known = [
        ({"hyperparameters": {"lr": 1e-5 * 1.8**n}, "action_space": 0, "reward_function": 0}, -float(n))
        for n in range(8)
    ]
    small = [study.suggest(space, known, seed=seed)["hyperparameters"]["lr"] < 1e-4 for seed in range(20)]
    assert sum(small) > 13


class TestSpace:
    def test_sizes_within_a_range_become_choices(self):
        space = a_space(hyperparameters={"batch_size": {"low": 32, "high": 128}})
        assert space["hyperparameters"] == {"batch_size": {"choices": [32, 64, 128]}}

    def test_equal_variants_count_once(self):
        space = a_space(action_spaces=[TABLE, RANGES], reward_functions=["a", "b", "b"])
        assert (len(space["action_spaces"]), space["reward_functions"]) == (2, ["a", "b"])
        assert combinations(space) == 4

    @pytest.mark.parametrize(
        ("changes", "code"),
        [
            ({}, "sweep_space_empty"),
            ({"reward_functions": ["a"]}, "sweep_space_empty"),
            ({"reward_functions": ["a", "  "]}, "training_reward_missing"),
            ({"reward_functions": list("bcdefg")}, "sweep_variants"),
            ({"hyperparameters": {"lr": {"low": 1e-3, "high": 1e-4}}}, "sweep_range"),
            ({"hyperparameters": {"lr": {"low": 1e-4, "high": 1e-4}}}, "sweep_range"),
            ({"hyperparameters": {"lr": {"low": 1e-4}}}, "sweep_range"),
            ({"hyperparameters": {"lr": {}}}, "sweep_range"),
            ({"hyperparameters": {"lr": 3}}, "sweep_range"),
            ({"hyperparameters": {"lr": {"choices": [1e-4]}}}, "sweep_range"),
            ({"hyperparameters": {"lr": {"choices": "ab"}}}, "sweep_range"),
            ({"hyperparameters": {"lr": {"low": 1e-4, "high": 1e-3, "log": True}}}, "sweep_range"),
            ({"hyperparameters": {"loss_type": {"low": "huber", "high": "huber"}}}, "sweep_range"),
            ({"hyperparameters": {"lr": {"low": 1e-4, "high": 2.0}}}, "training_hyperparameter"),
            ({"hyperparameters": {"lr": {"low": float("nan"), "high": 1e-3}}}, "training_hyperparameter"),
            ({"hyperparameters": {"lr": {"low": "x", "high": 1e-3}}}, "training_hyperparameter"),
            ({"hyperparameters": {"lr": {"choices": [[1], 1e-4]}}}, "training_hyperparameter"),
            ({"hyperparameters": {"depth": {"low": 1, "high": 2}}}, "training_hyperparameter_unknown"),
            ({"hyperparameters": {"depth": {}}}, "training_hyperparameter_unknown"),
            ({"hyperparameters": {"sac_alpha": {"low": 0.1, "high": 0.2}}}, "training_hyperparameter_unknown"),
            ({"hyperparameters": {"e_greedy_value": {"low": 0.1, "high": 0.2}}}, "training_exploration"),
            ({"action_spaces": [{"action_space_type": "x", "action_space": []}]}, "training_action_space"),
            ({"action_spaces": [{"action_space_type": "discrete", "action_space": []}]}, "training_action_count"),
        ],
    )
    def test_what_cannot_be_tried_is_refused(self, changes, code):
        with pytest.raises(UserFault) as refused:
            a_space(**changes)
        assert refused.value.code == code
        assert "%(" not in str(refused.value)

    @pytest.mark.parametrize(
        ("settings", "budget_s", "code"),
        [
            (1, 600, "sweep_settings"),
            (13, 600, "sweep_settings"),
            (True, 600, "sweep_settings"),
            (2.0, 600, "sweep_settings"),
            (3, 600, "sweep_combinations"),
            (2, 19, "sweep_budget"),
            (2, 86_401, "sweep_budget"),
            (2, 60.5, "sweep_budget"),
        ],
    )
    def test_a_size_that_does_not_fit_is_refused(self, settings, budget_s, code):
        with pytest.raises(UserFault) as refused:
            check_size(a_space(reward_functions=["b"]), settings, budget_s)
        assert refused.value.code == code
        assert "%(" not in str(refused.value)

    @pytest.mark.parametrize("settings", range(2, 13))
    def test_the_least_budget_gives_each_trial_five_seconds(self, settings):
        first, *_ = plan(settings, least_budget_s(settings))
        assert 5.0 <= first.seconds < 5.5
