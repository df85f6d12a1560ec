"""Why the static gate lets a network through or not."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "onnx_corrupt": _(
            "The ONNX file is damaged, incomplete or has unknown parts. Export it again; nothing may be appended to it."
        ),
        "onnx_too_big": _(
            "The ONNX file has too many parts (%(part)s, limit %(limit)s). Export the policy network alone."
        ),
        "onnx_opset": _(
            "The ONNX file must use the standard operator set, version %(low)s to %(high)s. Export it with another "
            "opset_version, such as torch.onnx.export(..., opset_version=17)."
        ),
        "onnx_domain": _(
            "The network uses %(operator)s of an operator set that is not part of standard ONNX (%(domain)s). Export "
            "it without custom operators."
        ),
        "onnx_functions": _(
            "The ONNX file defines functions, training information or sparse weights. Export a plain inference graph."
        ),
        "onnx_operator": _(
            "The operator %(operator)s is not allowed in a car's network (%(layer)s). It stands at: %(where)s. Use "
            "plain layers: convolution, dense, pooling, activations."
        ),
        "onnx_attribute": _(
            "The operator %(operator)s has an attribute that is not allowed here (%(attribute)s). It stands at: "
            "%(where)s. Export the network in evaluation mode, after policy.eval()."
        ),
        "onnx_external_data": _(
            "The weights that the ONNX file keeps outside of itself cannot be found %(problem)s. Export it again; with "
            "torch.onnx.export(..., external_data=False) it is one file."
        ),
        "onnx_external_missing": _(
            "The ONNX file keeps its weights in %(file)s, which is not in the upload. Upload both files, or a zip of "
            "both, or export it with torch.onnx.export(..., external_data=False)."
        ),
        "onnx_tensor": _(
            "A weight tensor contradicts itself: its shape, type and stored bytes do not fit. Export the network again."
        ),
        "onnx_tensor_type": _("Tensors of type %(type)s are not allowed. Export the network with 32-bit floats."),
        "onnx_graph": _("The ONNX graph is not well formed (%(problem)s). Export it again."),
        "onnx_dynamic": _(
            "Every size in the network must be fixed for a batch of one. Export it with an example input of that size "
            "and without dynamic_axes (or dynamic_shapes)."
        ),
        "onnx_inputs": _(
            "The network's inputs are %(found)s but model_metadata.json names the sensors %(expected)s. Name each "
            "input as its sensor: torch.onnx.export(..., input_names=[...])."
        ),
        "onnx_input_type": _("The input %(sensor)s must be %(expected)s."),
        "onnx_input_shape": _(
            "The input %(sensor)s has the shape %(found)s; it must be %(expected)s. It is the shape of the example "
            "input that torch.onnx.export is given."
        ),
        "onnx_output": _(
            "The network must answer one 32-bit float tensor of shape [1, %(expected)s] to fit the action space; it "
            "answers %(found)s. Return the logits (or the two actions) from forward(), and compare action_space with "
            "the training."
        ),
        "onnx_outputs": _(
            "Several outputs of the network fit the action space (%(found)s, each of shape [1, %(expected)s]). Return "
            "one of them from forward(), or name it: torch.onnx.export(..., output_names=['actions', ...])."
        ),
        "network_too_slow": _(
            "The network needs %(macs_million)s million multiplications a step; at most %(limit_million)s "
            "million are allowed. Train a smaller one."
        ),
        "network_too_wide": _("The network's intermediate results are too large for one step. Train a smaller one."),
        "non_finite_weights": _(
            "The network has weights that are NaN or infinite, so its training broke. Use an earlier checkpoint."
        ),
        "network_fails": _(
            "The network does not run: the inference engine refused it. Export it again with a current tool."
        ),
        "network_non_finite": _(
            "The network answers NaN or infinity to an ordinary picture. Use an earlier checkpoint."
        ),
    },
)
