"""How a car fails while it drives."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "non_finite_action": _(
            "The network answered NaN or infinity in step %(step)s. Check its weights and train it again."
        ),
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
