"""Where Paddock itself failed."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "platform",
    {
        "sandbox_unavailable": _(
            "This host cannot wall off models safely enough (level %(level)s, at least %(minimum)s is needed), so none "
            "is run. An operator sees with “manage.py doctor” what is missing."
        ),
        "worker_inexact": _(
            "This worker does not compute as every other: %(equal)s of %(runs)s golden runs came to what %(engine)s "
            "must come to. It takes no work, which waits for another worker. An operator sees with “manage.py doctor” "
            "what differs."
        ),
        "sandbox_failed": _("A walled-off process could not be started. The evaluation will be repeated."),
        "host_overloaded": _(
            "This host was too busy to run the network. Nothing is wrong with it; the evaluation will be repeated."
        ),
        "runner_timeout": _("The simulator did not finish within %(limit_s)s s. The evaluation will be repeated."),
        "runner_died": _("The simulator ended unexpectedly (%(how)s). The evaluation will be repeated."),
        "runner_protocol": _("The simulator sent something unreadable. The evaluation will be repeated."),
        "runner_error": _("The simulator failed (%(detail)s). The evaluation will be repeated."),
        "upload_busy": _(
            "Too many models are being read at the moment. Nothing is wrong with yours: try again in a minute."
        ),
        "conversion_failed": _("Reading the model failed on our side. Nothing is wrong with yours: try again later."),
        "sb3_needs_torch": _(
            "This site cannot read zips of stable-baselines3: PyTorch is not installed on it. Export the policy "
            "with torch.onnx.export() and upload the .onnx file, or ask the site's operator for training."
        ),
        "submit_failed": _(
            "Paddock failed to send the model to its race. The model is in your garage: submit it there yourself."
        ),
        "internal_error": _("Paddock made a mistake. Nothing is wrong with your model; it will be tried again."),
        "database_not_ready": _(
            "The database is not ready: %(problem)s. Make it so with “manage.py migrate” (“manage.py run” does it "
            "itself), or see to what DATABASE_URL and PADDOCK_DATA name."
        ),
        "database_damaged": _(
            "The database is damaged: %(problem)s. Restore the last good backup (“manage.py restore”) into an empty "
            "place."
        ),
        "database_tool_failed": _("%(tool)s failed: %(problem)s."),
        "storage_failed": _(
            "A stored file could not be read or written. Nothing is wrong with your model; it will be tried again."
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
