"""Why a TensorFlow graph cannot become ONNX."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "graph_unreadable": _(
            "The file model.pb is not a frozen TensorFlow graph or is damaged. Use agent/model.pb from the "
            "car's own archive."
        ),
        "graph_too_big": _(
            "The TensorFlow graph has too many parts (limit %(limit)s). Upload the frozen graph "
            "agent/model.pb, not a training graph."
        ),
        "graph_not_frozen": _(
            "The graph has weights that are not stored in it (%(node)s). Upload the frozen graph "
            "agent/model.pb from the car's archive."
        ),
        "graph_operation": _(
            "The TensorFlow operation %(operation)s cannot be converted (%(node)s). Export the network to ONNX "
            "yourself and upload that."
        ),
        "graph_output": _(
            "No policy output was found in the graph. It must end in ppo_head_0/policy or sac_policy_head_0/policy."
        ),
        "graph_inputs": _(
            "The graph reads %(found)s but model_metadata.json names the sensors %(expected)s. Upload the two "
            "files of the same training."
        ),
        "graph_invalid": _(
            "The graph contradicts itself at %(node)s: sizes or types do not fit. Use agent/model.pb from the "
            "car's own archive."
        ),
        "conversion_memory": _("Reading the network took more memory than any car needs. Upload a smaller network."),
        "conversion_time": _("Reading the network took longer than any car needs. Upload a simpler network."),
        "conversion_crashed": _("The network crashed the program that reads it. Export it again with a current tool."),
    },
)
