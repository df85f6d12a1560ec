"""Why a training or a vehicle is refused, and why a training ends early."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Paddock's own faults",
    "platform",
    {
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
    "user",
    {
        "vehicle_name_taken": _("You have another vehicle named “%(name)s”. Choose another name."),
        "vehicle_limit": _("You have reached the limit of %(limit)s vehicles. Delete one first."),
        "vehicle_not_yours": _("This vehicle is not in your garage. Choose one of yours."),
        "vehicle_sensors": _("A vehicle has one camera (%(cameras)s) and at most one lidar (%(lidars)s)."),
        "vehicle_lidar": _(
            "Only the sensor %(sensor)s has settings. Add it to the sensors, or leave the settings out."
        ),
        "reward_slow_to_load": _(
            "The time was used up before the training began: the lines outside of the reward function run once for "
            "each of %(count)s cars, and took %(ms)s ms. Compute less there."
        ),
        "reward_check_runs": _("One of your reward functions is being checked already. Try again in a few seconds."),
    },
)

register(
    "Trainings",
    "user",
    {
        "training_name_form": _(
            "A model's name has 1 to 64 letters (A to Z), digits and hyphens, without blanks. Choose another one."
        ),
        "training_name_taken": _("You have a model or a training named “%(name)s” already. Choose another name."),
        "training_algorithm": _("There is no algorithm “%(algorithm)s”. Choose ppo or sac."),
        "training_exploration": _(
            "“%(name)s” is no choice here: PPO and SAC try out what they are unsure of, more of it with a greater "
            "entropy. Leave it out."
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
        "training_jobs_at_once": _(
            "You have reached the limit of %(limit)s trainings at a time. Stop one, or wait for its end."
        ),
        "training_minutes_left": _(
            "%(left)s of %(limit)s training minutes are left this month (queued and running "
            "trainings count in full). Choose a shorter training."
        ),
        "training_no_model": _(
            "This model of the training does not exist. Wait for the first iteration, or choose the other one."
        ),
        "clone_not_yours": _(
            "This model cannot be cloned: it is neither yours nor shared. Choose one of yours or a shared one."
        ),
        "clone_sensors": _(
            "The model to be cloned sees with %(has)s, this vehicle with %(wanted)s. Choose a vehicle with the same "
            "sensors."
        ),
        "clone_network": _(
            "The model to be cloned has the network %(has)s, this vehicle %(wanted)s. Choose a vehicle with the same "
            "network."
        ),
        "class_learner_in_duels": _(
            "The car of %(racer)s is in drawn duels of %(race)s. Cancel and delete that race, or delete the class."
        ),
        "clone_actions": _(
            "The model to be cloned chooses among %(has)s, this training among %(wanted)s. Their values may differ, "
            "their number and kind may not."
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
        "training_under_way": _("Only a training that is over can be deleted. Stop this one first."),
        "training_model_races": _(
            "The model “%(name)s” is in the race “%(race)s”, which is not over. Delete the training without its "
            "models, or wait for the end of the race."
        ),
        "training_model_drives": _(
            "The model “%(name)s” is in a run that waits or is driven. Delete the training without its models, or wait "
            "for the end of the run."
        ),
    },
)

register(
    "Trainings",
    "platform",
    {
        "training_unavailable": _(
            "Training is not installed on this site. The operator can add it with “make training”."
        ),
        "training_paused": _("The operator of this site has paused trainings."),
        "trainer_died": _("The training ended unexpectedly (%(how)s). It resumes from its last checkpoint."),
        "trainer_lost": _("The training worker was lost. The training resumes from its last checkpoint."),
        "trainer_protocol": _("The training sent invalid data. It resumes from its last checkpoint."),
        "trainer_error": _("The training failed (%(detail)s). It resumes from its last checkpoint."),
        "training_gave_up": _(
            "Paddock failed to train this model %(attempts)s times. The model is fine, and its "
            "minutes do not count. Train it again later."
        ),
    },
)
