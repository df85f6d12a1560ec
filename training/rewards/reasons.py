"""Reason codes of reward functions."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

REWARD_REASONS = register(
    "Reward functions",
    invalid={
        "reward_length": _(
            "The reward function has %(length)s characters. It must have at least one and at most %(limit)s."
        ),
        "reward_syntax": _("Line %(line)s of the reward function is not Python: %(detail)s."),
        "reward_function_missing": _(
            "There is no function “reward_function”. Define one at the left margin: “def reward_function(params):”."
        ),
        "reward_function_twice": _(
            "Line %(line)s defines “reward_function” a second time. Keep one of them; other functions are free in "
            "name and number."
        ),
        "reward_function_kind": _(
            "Line %(line)s makes “reward_function” something that answers later instead of at once (“async”, “yield”). "
            "Write a plain function that returns a number."
        ),
        "reward_arguments": _(
            "“reward_function” in line %(line)s takes %(count)s arguments. It must take one (params), or the twelve of "
            "the form of 2018; “self” may stand before them. Others need a default."
        ),
        "reward_undefined_name": _("Line %(line)s uses the undefined name “%(name)s”."),
        "reward_mistake": _("Line %(line)s will fail when it runs: %(detail)s."),
        "reward_forbidden_name": _(
            "Line %(line)s uses “%(name)s”, which reward functions cannot use: files, network and other programs "
            "are not available. Compute with the values in params."
        ),
        "reward_import_not_allowed": _(
            "Line %(line)s imports “%(name)s”. A reward function has no files, processes, network or interpreter "
            "internals: it can import numpy, scipy, shapely, and modules of the standard library that only compute. "
            "The guide lists them."
        ),
        "reward_import_failed": _("The import in line %(line)s failed: %(detail)s."),
        "reward_raised": _("Line %(line)s of the reward function failed: %(error)s."),
        "reward_param_unknown": _(
            "Line %(line)s asks for “%(name)s”, which params do not have. Did you mean “%(meant)s”?"
        ),
        "reward_not_a_number": _(
            "The reward function did not return a number in line %(line)s. Every path must return a number."
        ),
        "reward_not_finite": _(
            "The reward function returned %(value)s in line %(line)s. It must return a finite number: look for a "
            "division by something very small, or a logarithm of zero."
        ),
        "reward_too_large": _(
            "The reward function returned %(value)s in line %(line)s. A reward must be between -100000 and 100000."
        ),
        "reward_too_slow": _(
            "The reward function is too slow: after 5 s of computing it was in line %(line)s. Look for an endless or a "
            "very long loop there."
        ),
        "reward_memory": _("The reward function used up the memory in line %(line)s. Keep less from step to step."),
        "reward_prints_too_much": _(
            "The reward function printed more than 64,000 characters in one call, the last of them in line %(line)s. "
            "Print less."
        ),
        "reward_stuck": _(
            "The reward function stopped its process (%(how)s). Use only plain calculations with params."
        ),
    },
)

# Of functions that may be trained with.
REWARD_WARNINGS = register(
    "Reward functions",
    invalid={
        "reward_slow": _(
            "A call takes %(ms)s ms. The %(steps)s steps before each update of the network then take %(seconds)s s for "
            "the reward function alone, so that the training learns little in its time. A fast function takes less "
            "than 1 ms: compute what does not change once, outside of the function."
        ),
        "reward_slow_start": _(
            "The lines outside of the reward function take %(ms)s ms. They run once for each of %(count)s cars, so the "
            "training begins after %(seconds)s s."
        ),
        "reward_slow_in_all": _(
            "A call takes %(ms)s ms: the time for a try was used up after %(count)s of %(total)s points."
        ),
        "reward_first_step": _(
            "Line %(line)s compares “steps” with %(value)s, which never holds: “steps” is 2 in the first call of an "
            "episode, because the car drives before it is rewarded. Compare with 2."
        ),
        "reward_percent": _(
            "Line %(line)s compares “progress” with %(value)s. “progress” is a percentage: a finished lap has 100."
        ),
        "reward_param_foreign": _("Line %(line)s asks for “%(name)s”, which params never have."),
        "reward_remembers": _(
            "After another episode the same drive has other rewards: the function keeps values from the episode "
            "before. Reset them when “steps” falls."
        ),
        "reward_is_random": _("The same drive has other rewards the second time: the function is random."),
    },
)

# Of an audit: what the function pays for.
REWARD_FINDINGS = register(
    "Reward functions",
    invalid={
        "reward_pays_fast": _("A fast lap is worth %(fast)s, a slow lap on the same line %(slow)s: driving fast pays."),
        "reward_pays_slow": _(
            "A slow lap is worth %(slow)s, a fast lap on the same line only %(fast)s: driving slowly pays."
        ),
        "reward_pays_alike": _(
            "A fast lap is worth %(fast)s, a slow lap on the same line %(slow)s: speed makes no difference."
        ),
        "reward_follows_progress": _("More progress a second has more reward (rank correlation %(value)s)."),
        "reward_against_progress": _("More progress a second has less reward (rank correlation %(value)s)."),
        "reward_ignores_progress": _("Reward and progress a second are hardly connected (rank correlation %(value)s)."),
        "reward_follows_laps": _("Shorter laps have more reward (rank correlation with the lap time %(value)s)."),
        "reward_against_laps": _("Longer laps have more reward (rank correlation with the lap time %(value)s)."),
        "reward_ignores_laps": _(
            "Reward and lap time are hardly connected (rank correlation with the lap time %(value)s)."
        ),
        "reward_order": _("%(same)s of %(all)s pairs of drives have the same order by reward and by time."),
        "reward_standing_pays": _("Almost standing still is worth %(value)s, the fast lap %(lap)s: not driving pays."),
        "reward_circles_pay": _(
            "A step of driving in circles earns %(value)s, a step of the better of the fast and the slow lap %(lap)s: "
            "the car may learn circles."
        ),
        "reward_crash_pays": _(
            "Leaving the road or crashing is worth %(value)s, the fast lap %(lap)s: ending early pays."
        ),
        "reward_no_traps": _("Standing still, driving in circles and crashing pay less than a lap."),
        "reward_steps_failed": _(
            "%(count)s of %(total)s steps had no valid reward, which counts as 0 here. A training ends at the first."
        ),
    },
)

register(
    "Reward functions",
    unavailable={
        "reward_check_failed": _(
            "The site could not test the reward function. The function is fine. Try again in a minute."
        ),
        "reward_check_busy": _("Too many reward functions are being tested right now. Try again in a minute."),
    },
)
