"""Why a model is not kept, or a run fails."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Upload",
    "user",
    {
        "garage_full": _(
            "Your garage holds %(limit)s models, which is the most it can. Delete one that you no longer race."
        ),
        "learner_shares_nothing": _("An account of a class shares no models."),
        "storage_full": _(
            "What you have stored takes up %(limit_mb)s MB, which is the most that one racer may. Your usage page says "
            "what it is. Delete models and trainings that you need no more (networks that never raced are removed "
            "after a day); for more, ask an operator."
        ),
        "seen_lap": _("There is no lap %(lap)s to look at: the run has %(laps)s."),
        "model_name_missing": _("The model needs a name with at least one visible character."),
        "model_name_too_long": _("The name is longer than %(limit)s characters. Choose a shorter one."),
        "model_name_taken": _("You already have a model named %(name)s. Choose another name."),
        "description_too_long": _("The description is longer than %(limit)s characters. Shorten it."),
        "model_look": _(
            "Invalid look. Choose the shell from %(known)s, and write the colour as #rrggbb, such as #3b82f6."
        ),
        "model_deleted_not_shared": _("A deleted model cannot be shared. Upload it again, or share another one."),
        "source_not_kept": _(
            "There is no uploaded file of this model: it was made on this site, or uploaded before such files were "
            "kept. Download it in another format, or upload the same file once more, which keeps it."
        ),
        "model_not_yours": _("This model is not in your garage. Choose one of your own, or upload it first."),
    },
)

register(
    "Conversion of a TensorFlow graph",
    "user",
    {
        "conversion_memory": _("Reading the network took more memory than any car needs. Upload a smaller network."),
        "conversion_time": _("Reading the network took longer than any car needs. Upload a simpler network."),
        "conversion_crashed": _("The network crashed the program that reads it. Export it again with a current tool."),
    },
)

register(
    "On the track",
    "user",
    {
        "policy_late": _(
            "The network was too slow: in step %(step)s its time was used up (%(step_s)s s for a step, %(overage_s)s s "
            "to spare in all, %(total_s)s s for the whole run). Train a smaller network."
        ),
        "policy_late_exact": _(
            "The network was too slow: in step %(step)s its time was used up (%(step_s)s s for a step, %(overage_s)s s "
            "to spare in all, %(total_s)s s for the whole run). Its answers are so close to each other, or so inexact, "
            "that %(exact)s steps had to be computed in double precision, which takes longer. Train a smaller network, "
            "or one that decides more clearly."
        ),
        "policy_died": _(
            "The process that runs the network ended in step %(step)s (%(how)s). Export the network again, and test it "
            "with onnxruntime before you upload it."
        ),
        "policy_memory": _(
            "The network needed more memory than the %(limit_mb)s MB it may use. Train a smaller network."
        ),
        "policy_protocol": _(
            "The process that runs the network sent something other than one action in step %(step)s. Export the "
            "network again."
        ),
        "policy_refused": _(
            "The runtime cannot load this network: %(detail)s. Export it again, and test it with onnxruntime "
            "%(version)s."
        ),
        "stopped": _("The evaluation was stopped before its end. Submit the model again to have it evaluated."),
    },
)

register(
    "Paddock's own faults",
    "platform",
    {
        "sandbox_unavailable": _(
            "This host cannot sandbox models safely enough (level %(level)s, at least %(minimum)s is needed), so no "
            "model is run. An operator sees with “manage.py doctor” what is missing."
        ),
        "worker_inexact": _(
            "This worker does not compute like every other: %(equal)s of %(runs)s golden runs came to what %(engine)s "
            "must come to. It takes no work, which waits for another worker. An operator sees with “manage.py doctor” "
            "what differs."
        ),
        "sandbox_failed": _("A sandboxed process could not be started. The evaluation will be repeated."),
        "host_overloaded": _(
            "This host was too busy to run the network. Nothing is wrong with it; the evaluation will be repeated."
        ),
        "runner_timeout": _("The simulator did not finish within %(limit_s)s s. The evaluation will be repeated."),
        "runner_died": _("The simulator ended unexpectedly (%(how)s). The evaluation will be repeated."),
        "runner_protocol": _("The simulator sent something unreadable. The evaluation will be repeated."),
        "runner_error": _("The simulator failed (%(detail)s). The evaluation will be repeated."),
        "export_failed": _(
            "Writing the model failed on our side. Nothing is wrong with yours: try again later, or download another "
            "format."
        ),
        "conversion_failed": _("Reading the model failed on our side. Nothing is wrong with yours: try again later."),
        "upload_busy": _(
            "Too many models are being read at the moment. Nothing is wrong with yours: try again in a minute."
        ),
        "sb3_needs_torch": _(
            "This site cannot read zips of stable-baselines3: PyTorch is not installed on it. Export the policy "
            "with torch.onnx.export() and upload the .onnx file, or ask the site's operator for training."
        ),
        "file_damaged": _(
            "A stored file is damaged. Nothing is wrong with your model; an operator is told, and it will be tried "
            "again."
        ),
        "lease_expired": _("The worker that ran this evaluation disappeared. It will be tried again."),
        "platform_gave_up": _(
            "Paddock failed to run this model %(attempts)s times. Nothing is wrong with it and the attempt does not "
            "count: submit it again later."
        ),
    },
)

register(
    "Several cars in a race",
    "user",
    {
        "rivals_race_type": _("Other cars race along in head-to-head only. Choose the race type head_to_head."),
        "rivals_with_bots": _("Submitted cars race each other without bot cars. Set the number of bot cars to 0."),
        "too_many_rivals": _("At most %(limit)s other cars may race along. Leave some of them out."),
    },
)

register(
    "Reports",
    "user",
    {
        "report_model_gone": _(
            "There is no such model for you: it has left its garage or is not shared any more. Choose another."
        ),
        "report_tracks": _(
            "Name tracks for a report on chosen tracks, and for no other: the other sets name their own."
        ),
        "report_track_gone": _("There is no track %(track)s here. Choose another one."),
        "report_too_many_tracks": _("A report drives at most %(limit)s tracks. Choose fewer."),
        "report_track_without_shape": _(
            "The shape of %(track)s is not known here, so no car can drive on it. Leave it out."
        ),
        "report_no_way_round": _(
            "%(track)s is driven from start to end: it has no lap that could begin anywhere. Choose a loop for the "
            "variations."
        ),
        "report_sensors": _(
            "The model reads %(sensors)s, which no track of this simulator serves. Train it again with other sensors."
        ),
        "report_empty": _("The report would drive nothing. Choose tracks, a track for the variations, or both."),
        "report_seed": _("The seed must be a whole number from 0 to %(most)s."),
        "report_direction": _("There is no such direction. Choose one of %(known)s."),
        "reports_at_once": _(
            "%(limit)s reports of yours are under way, as many as may be at a time. Wait for one, or stop one."
        ),
        "reports_a_day": _(
            "You have asked for %(limit)s reports within 24 hours, as many as a racer may. Come back later, or ask an "
            "operator for more."
        ),
        "reports_kept": _("You keep %(limit)s reports, as many as a racer may. Delete one that you need no more."),
        "report_under_way": _("The report is still being driven. Stop it first."),
    },
)
