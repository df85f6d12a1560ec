"""Why a model is not kept, or a run fails."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Upload",
    invalid={
        "seen_lap": _("There is no lap %(lap)s to look at: the run has %(laps)s."),
        "model_name_missing": _("Enter a model name with at least one visible character."),
        "model_name_too_long": _("The name is longer than %(limit)s characters. Choose a shorter one."),
        "description_too_long": _("The description is longer than %(limit)s characters. Shorten it."),
        "model_look": _(
            "Invalid look. Choose the shell from %(known)s, and write the colour as #rrggbb, such as #3b82f6."
        ),
    },
    forbidden={
        "learner_shares_nothing": _("An account of a class shares no models."),
        "model_not_yours": _("This model is not in your garage. Choose one of your models, or upload it first."),
    },
    not_found={
        "source_not_kept": _(
            "This model has no uploaded file: it was trained here, or uploaded before files were "
            "kept. Download another format, or upload the file again."
        ),
    },
    conflict={
        "garage_full": _("Your garage is full (%(limit)s models). Delete one that you no longer need."),
        "storage_full": _(
            "Your storage is full (%(limit_mb)s MB). See your usage page. Delete models and "
            "trainings that you no longer need (networks that never raced are removed after a day), "
            "or ask an operator for more."
        ),
        "model_name_taken": _("You already have a model named %(name)s. Choose another name."),
        "model_deleted_not_shared": _("A deleted model cannot be shared. Upload it again, or share another one."),
    },
)

register(
    "Conversion of a TensorFlow graph",
    invalid={
        "conversion_memory": _("Reading the network needed too much memory. Upload a smaller network."),
        "conversion_time": _("Reading the network took too long. Upload a simpler network."),
        "conversion_crashed": _("The network crashed the program that reads it. Export it again with a current tool."),
    },
)

register(
    "On the track",
    invalid={
        "policy_late": _(
            "The network was too slow: it ran out of time in step %(step)s (%(step_s)s s per step, "
            "%(overage_s)s s reserve, %(total_s)s s for the whole run). Train a smaller network."
        ),
        "policy_late_exact": _(
            "The network was too slow: it ran out of time in step %(step)s (%(step_s)s s per step, "
            "%(overage_s)s s reserve, %(total_s)s s for the whole run). Its outputs were too close "
            "together, so %(exact)s steps had to be repeated in double precision, which takes "
            "longer. Train a smaller network, or train longer for clearer decisions."
        ),
        "policy_died": _(
            "The process that runs the network ended in step %(step)s (%(how)s). Export the network again, and test it "
            "with onnxruntime before you upload it."
        ),
        "policy_memory": _("The network needed more than %(limit_mb)s MB of memory. Train a smaller network."),
        "policy_protocol": _(
            "The network's process did not answer with one action in step %(step)s. Export the network again."
        ),
        "policy_refused": _(
            "The runtime cannot load this network: %(detail)s. Export it again, and test it with onnxruntime "
            "%(version)s."
        ),
        "stopped": _("The evaluation was stopped before its end. Submit the model again."),
    },
)

register(
    "Paddock's own faults",
    unavailable={
        "sandbox_unavailable": _(
            "This host cannot sandbox models safely (level %(level)s, minimum %(minimum)s), so it "
            "runs none. “manage.py doctor” shows what is missing."
        ),
        "worker_inexact": _(
            "This worker's results differ from the reference: only %(equal)s of %(runs)s golden runs "
            "match %(engine)s. It takes no jobs. “manage.py doctor” shows the differences."
        ),
        "sandbox_failed": _("A sandboxed process could not be started. The evaluation will be repeated."),
        "host_overloaded": _(
            "This host was too busy to run the network. The network is fine; the evaluation will be repeated."
        ),
        "runner_timeout": _("The simulator did not finish within %(limit_s)s s. The evaluation will be repeated."),
        "runner_died": _("The simulator ended unexpectedly (%(how)s). The evaluation will be repeated."),
        "runner_protocol": _("The simulator sent an unreadable answer. The evaluation will be repeated."),
        "runner_error": _("The simulator failed (%(detail)s). The evaluation will be repeated."),
        "export_failed": _(
            "The site could not write the model. Your model is fine. Try again later, or download another format."
        ),
        "conversion_failed": _("The site could not read the model. Your model is fine. Try again later."),
        "upload_busy": _("Too many models are being read right now. Try again in a minute."),
        "file_damaged": _("A stored file is damaged. The operator has been notified, and the run will be repeated."),
        "lease_expired": _("The worker that ran this evaluation disappeared. The evaluation will be repeated."),
        "platform_gave_up": _(
            "Paddock failed to run this model %(attempts)s times. The model is fine and the attempt "
            "does not count. Submit it again later."
        ),
    },
)

register(
    "Several cars in a race",
    invalid={
        "rivals_race_type": _("Rival cars need the race type head_to_head."),
        "rivals_with_bots": _("Races between submitted cars have no bot cars. Set their number to 0."),
        "too_many_rivals": _("At most %(limit)s rival cars are possible. Remove some."),
    },
)

register(
    "Reports",
    invalid={
        "report_tracks": _("List tracks only for a report on chosen tracks. The other sets include their own tracks."),
        "report_too_many_tracks": _("A report drives at most %(limit)s tracks. Choose fewer."),
        "report_track_without_shape": _(
            "The shape of %(track)s is not known here, so no car can drive on it. Leave it out."
        ),
        "report_no_way_round": _(
            "%(track)s is driven from start to end: it has no lap that could begin anywhere. Choose a loop for the "
            "variations."
        ),
        "report_sensors": _(
            "This simulator does not support the sensors %(sensors)s of the model. Train it again with other sensors."
        ),
        "report_empty": _("Choose tracks, a track for the variations, or both."),
        "report_seed": _("The seed must be a whole number from 0 to %(most)s."),
        "report_direction": _("There is no such direction. Choose one of %(known)s."),
    },
    not_found={
        "report_model_gone": _("This model is not available: it was deleted or is no longer shared. Choose another."),
        "report_track_gone": _("There is no track %(track)s here. The closest names are: %(nearest)s."),
    },
    conflict={
        "reports_at_once": _("You have %(limit)s reports in progress, the maximum. Wait for one, or stop one."),
        "reports_a_day": _(
            "You requested %(limit)s reports in 24 hours, the maximum. Try again later, or ask an operator for more."
        ),
        "reports_kept": _("You already have %(limit)s reports, the maximum. Delete one you no longer need."),
        "report_under_way": _("The report is still being driven. Stop it first."),
    },
)

register(
    "Commands",
    not_found={
        "worker_unknown": _("There is no worker %(worker)s. Known workers: %(known)s."),
    },
)
