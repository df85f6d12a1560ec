"""Reason codes of trainings and vehicles."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Paddock's own faults",
    unavailable={
        "submit_failed": _(
            "Paddock failed to send the model to its race. The model is in your garage: submit it there yourself."
        ),
        "evaluate_failed": _(
            "The test drive failed on our side. The model is in your garage: start a test drive there."
        ),
    },
)

register(
    "Vehicles",
    invalid={
        "vehicle_sensors": _("A vehicle has one camera (%(cameras)s) and at most one lidar (%(lidars)s)."),
        "vehicle_lidar": _(
            "Only the sensor %(sensor)s has settings. Add it to the sensors, or leave the settings out."
        ),
        "reward_slow_to_load": _(
            "The time was used up before the training began: the lines outside of the reward function run once for "
            "each of %(count)s cars, and took %(ms)s ms. Compute less there."
        ),
    },
    forbidden={
        "vehicle_not_yours": _("This vehicle is not in your garage. Choose one of yours."),
    },
    conflict={
        "vehicle_name_taken": _("You have another vehicle named “%(name)s”. Choose another name."),
        "vehicle_limit": _("You have reached the limit of %(limit)s vehicles. Delete one first."),
        "reward_check_runs": _("One of your reward functions is being checked already. Try again in a few seconds."),
    },
)

register(
    "Trainings",
    invalid={
        "training_name_form": _(
            "A model's name has 1 to 64 letters (A to Z), digits and hyphens, without blanks. Choose another one."
        ),
        "training_algorithm": _("There is no algorithm “%(algorithm)s”. Choose ppo or sac."),
        "training_exploration": _(
            "“%(name)s” is not available: PPO and SAC explore by their entropy bonus. Leave it out, and raise the "
            "entropy to explore more."
        ),
        "training_hyperparameter_unknown": _(
            "There is no hyperparameter “%(name)s” for this algorithm. It has: %(known)s."
        ),
        "training_hyperparameter": _(
            "%(label)s must be a number from %(low)s to %(high)s (batch size, epochs and episodes are whole numbers)."
        ),
        "training_loss_type": _("The loss is “huber” or “mean squared error”."),
        "training_batch_size": _("The batch size must be one of %(sizes)s."),
        "training_sac_continuous": _("SAC needs ranges. Choose “ranges” as the action space, or train with PPO."),
        "training_action_space": _(
            "An action space is “discrete”, a list of actions with steering_angle and speed, or “continuous”, with low "
            "and high of both."
        ),
        "training_action_count": _("A discrete action space has %(low)s to %(high)s actions, not %(count)s."),
        "training_action_value": _("Action %(where)s: enter a %(label)s from %(low)s to %(high)s."),
        "training_range_value": _("Enter a %(label)s from %(low)s to %(high)s."),
        "training_action_bounds": _("The lowest %(label)s must be less than the highest."),
        "training_minutes": _("A training lasts a whole number of minutes from %(low)s to %(high)s."),
        "training_steps": _("The number of steps that ends the training must be a whole number of at least 1."),
        "training_clean_laps": _(
            "The number of clean laps that ends the training must be a whole number from %(low)s to %(high)s."
        ),
        "training_alternate_direction": _("Whether the direction alternates is true or false."),
        "training_randomisation": _("%(label)s must be a whole number of percent, 0 to 100."),
        "training_tracks": _("A training drives on at most %(limit)s tracks, each of them once."),
        "training_trials": _("An evaluation has %(low)s to %(high)s trials."),
        "training_best_metric": _("The best model is the best by progress, reward or lap_time."),
        "training_seed": _("The seed must be a whole number from 0 to 2147483647."),
        "training_evaluate_on": _(
            "The test drive after training is not possible on %(track)s: %(problem)s Choose another track, or none."
        ),
        "training_course": _(
            "The race type does not match the obstacles (%(problem)s). Object avoidance has boxes, head-to-head "
            "has bot cars, a time trial has neither."
        ),
        "training_reward_missing": _("Write a reward function, or choose one of the examples."),
        "sweep_name_form": _(
            "A sweep's name has 1 to %(limit)s letters (A to Z), digits and hyphens, without blanks. Choose another "
            "one."
        ),
        "sweep_settings": _("A sweep tries a whole number of settings from %(low)s to %(high)s."),
        "sweep_budget": _("This sweep needs a budget of %(low)s to %(high)s seconds."),
        "sweep_range": _(
            "The values of “%(name)s” need a low end below the high end, or at least two different choices."
        ),
        "sweep_variants": _("Try at most %(limit)s action spaces and %(limit)s reward functions beside the first."),
        "sweep_space_empty": _(
            "Choose what the settings differ in: a hyperparameter, another action space or another reward function."
        ),
        "sweep_combinations": _("There are only %(count)s different settings. Try fewer, or vary more."),
        "clone_sensors": _(
            "The model to be cloned sees with %(has)s, this vehicle with %(wanted)s. Choose a vehicle with the same "
            "sensors."
        ),
        "clone_network": _(
            "The model to be cloned has the network %(has)s, this vehicle %(wanted)s. Choose a vehicle with the same "
            "network."
        ),
        "clone_actions": _(
            "The cloned model has the actions %(has)s, this training has %(wanted)s. Values may differ; number "
            "and kind must match."
        ),
        "clone_frame_stack": _(
            "The model to be cloned reads the last %(count)s observations at once (frame_stack); trainings here read "
            "one. Clone another model."
        ),
        "clone_not_ours": _(
            "This model's network differs from the networks trained here, so it cannot be trained "
            "further. Clone a model trained on this site, a house car, or a console model with the "
            "shallow network and a camera."
        ),
        "training_memory": _(
            "The training needed more than the %(limit_mb)s MB of memory that it may use. Keep less in the reward "
            "function from step to step."
        ),
        "training_diverged": _(
            "The training diverged. Choose a smaller learning rate, smaller rewards, a discount "
            "factor below 1 or the Huber loss. The model from before is kept."
        ),
        "training_broke_down": _(
            "The training broke down %(attempts)s times without getting any further, outside of the lines of your "
            "reward function (%(how)s). A function that changes anything but its own values does that. Try one of the "
            "examples instead of it; if that breaks down as well, tell whoever operates this site."
        ),
    },
    forbidden={
        "clone_not_yours": _(
            "This model cannot be cloned: it is neither yours nor shared. Choose one of yours or a shared one."
        ),
    },
    conflict={
        "training_name_taken": _("You have a model or a training named “%(name)s” already. Choose another name."),
        "training_jobs_at_once": _(
            "You have reached the limit of %(limit)s trainings at a time. Stop one, or wait for its end."
        ),
        "training_minutes_left": _(
            "%(left)s of %(limit)s training minutes are left this month (queued and running "
            "trainings count in full). Choose a shorter training."
        ),
        "training_of_sweep": _("This training is a trial of a sweep. Delete the sweep: its trials go with it."),
        "sweep_without_model": _("No setting led to a model: no trial had an evaluation. Choose a larger budget."),
        "sweep_running": _("Only a sweep that is over can be deleted. Stop this one first."),
        "sweep_name_taken": _("You have a running sweep named “%(name)s” already. Choose another name."),
        "training_no_model": _(
            "This training does not have that model yet. Wait for the first iteration, or choose the other model."
        ),
        "training_under_way": _("Only a training that is over can be deleted. Stop this one first."),
        "training_model_races": _(
            "The model “%(name)s” is entered in “%(race)s”, which is still running. Delete the training without "
            "its models, or wait until the race closes."
        ),
        "training_model_drives": _(
            "The model “%(name)s” has a queued or running run. Delete the training without its models, or wait "
            "until the run ends."
        ),
    },
)

register(
    "Trainings",
    unavailable={
        "training_unavailable": _(
            "Training is not installed on this site. The operator can add it with “make training”."
        ),
        "training_paused": _("The operator of this site has paused trainings."),
        "trainer_died": _("The training ended unexpectedly (%(how)s). It resumes from its last checkpoint."),
        "trainer_lost": _("The training worker was lost. The training resumes from its last checkpoint."),
        "trainer_protocol": _("The training sent invalid data. It resumes from its last checkpoint."),
        "trainer_error": _("The training failed (%(detail)s). It resumes from its last checkpoint."),
        "sweep_broke_down": _(
            "Paddock could not choose the next setting of this sweep. The trials so far stay. Start a new sweep."
        ),
        "training_gave_up": _(
            "Paddock failed to train this model %(attempts)s times. The model is fine, and its "
            "minutes do not count. Train it again later."
        ),
    },
)
