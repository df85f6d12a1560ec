"""The lessons of "Learn": order, titles, suggested trainings. Texts: ``training/templates/lessons``."""

from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _

# Ten seconds of training on the shortest track: it ends as soon as the car drives cleanly.
QUICK = {"track": "oval", "stop_minutes": "1", "stop_clean_laps": "3"}


@dataclass(frozen=True)
class Lesson:
    slug: str
    title: Promise
    summary: Promise
    tries: tuple[tuple[Any, str], ...] = ()


def _lesson(slug: str, title: Promise, summary: Promise, *tries: tuple[Promise, str]) -> Lesson:
    return Lesson(slug, title, summary, tries)


def _try(label: Promise, **fields: str) -> tuple[Promise, str]:
    return label, urlencode({**QUICK, **fields})


LESSONS = (
    _lesson(
        "agent",
        _("Agent and environment"),
        _("The learner, its environment, and the training loop."),
        _try(_("Train a first car"), name="first-car"),
    ),
    _lesson(
        "three-ways",
        _("Three ways to learn"),
        _("Supervised, unsupervised and reinforcement learning."),
        _try(_("Learn from consequences"), name="from-consequences"),
        _try(_("Learn with a wrong aim"), name="wrong-aim", lesson="slow"),
    ),
    _lesson(
        "state-and-action",
        _("State and action"),
        _("What the car observes 15 times a second, and its actions."),
        _try(_("Train with five actions"), name="five-actions"),
        _try(
            _("Train with twenty-one"),
            name="many-actions",
            steering_max="30",
            steering_granularity="7",
            speed_max="2.4",
            speed_granularity="3",
        ),
    ),
    _lesson(
        "reward",
        _("Reward"),
        _("One number that defines the goal."),
        _try(_("Reward the centre line"), name="centre-line", example="follow_centre_line"),
        _try(_("Reward being on the road"), name="inside-borders", example="stay_inside_borders"),
        _try(_("Reward the right direction"), name="direction", example="follow_direction"),
    ),
    _lesson(
        "policy",
        _("Policy"),
        _("The result of training: a network that turns pictures into actions."),
        _try(_("Train, then clone and continue"), name="policy"),
    ),
    _lesson(
        "episode-and-discount",
        _("Episode and discount"),
        _("How far ahead a car thinks."),
        _try(_("Look two seconds ahead"), name="far-sighted", discount_factor="0.97"),
        _try(_("Look at the next step only"), name="short-sighted", discount_factor="0"),
        _try(_("Look a minute ahead"), name="a-minute", discount_factor="0.999"),
    ),
    _lesson(
        "value",
        _("Value and Q functions"),
        _("What a place on the road is worth, and what an action there."),
        _try(_("Watch a value grow"), name="value"),
        _try(_("Value of the next step only"), name="no-future", discount_factor="0"),
    ),
    _lesson(
        "exploration",
        _("Exploration and exploitation"),
        _("Why a car in training drives below its best."),
        _try(_("Explore a little"), name="little-entropy", beta_entropy="0"),
        _try(_("Explore a lot"), name="much-entropy", beta_entropy="0.3"),
    ),
    _lesson(
        "ppo-and-sac",
        _("PPO and SAC"),
        _("Two ways to learn from the same driving."),
        _try(_("Train with PPO"), name="with-ppo", action_space_type="continuous", algorithm="ppo"),
        _try(_("Train with SAC"), name="with-sac", action_space_type="continuous", algorithm="sac"),
    ),
    _lesson(
        "hyperparameters",
        _("Hyperparameters"),
        _("What each one does, and when to change it."),
        _try(_("Learn from large batches"), name="large-batch", batch_size="512"),
        _try(_("Learn from small batches"), name="small-batch", batch_size="32"),
        _try(
            _("Explore first, then drive precisely"),
            name="falling",
            beta_entropy="0.05",
            entropy_decay="1",
        ),
    ),
    _lesson(
        "sparse-rewards",
        _("Sparse rewards and shaping"),
        _("Why paying for the finish alone teaches nothing at first."),
        _try(_("Pay at the finish only"), name="sparse", lesson="sparse"),
        _try(_("Pay for every metre"), name="shaped", example="race"),
    ),
    _lesson(
        "reward-graph",
        _("Reading the reward graph"),
        _("What rises, what should not fall, and when to stop."),
        _try(_("Watch a graph rise"), name="graph", stop_clean_laps="10"),
    ),
    _lesson(
        "zig-zag",
        _("Why a car zig-zags"),
        _("A habit of many trained cars, where it comes from, and three cures."),
        _try(_("A car that sways"), name="swaying", example="follow_centre_line"),
        _try(_("A calm one"), name="calm", example="prevent_zig_zag"),
    ),
    _lesson(
        "beyond-one-track",
        _("Other tracks and races"),
        _("Whether a car has learned to drive, and how to train for boxes, bots and duels."),
        _try(
            _("Train for boxes"),
            name="for-boxes",
            race_type="object_avoidance",
            example="stay_in_lane_without_crashing",
        ),
        _try(
            _("Train for bots"),
            name="for-bots",
            race_type="head_to_head",
            example="stay_in_lane_without_crashing",
            discount_factor="0.99",
        ),
    ),
)
BY_SLUG = {lesson.slug: lesson for lesson in LESSONS}

# Reward functions that belong to a lesson and are no example to keep.
LESSON_CODE = {
    "sparse": '''def reward_function(params):
    """Nothing on the way, much at the finish."""
    if params["progress"] >= 100:
        return 100.0
    return 0.0
''',
    "slow": '''def reward_function(params):
    """More the slower it goes, as long as it is on the road."""
    if not params["all_wheels_on_track"]:
        return 0.0
    return 4.0 - params["speed"]
''',
}
