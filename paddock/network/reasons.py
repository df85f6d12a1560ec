"""The reasons for which a network cannot be read."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Upload",
    too_large={
        "model_too_large": _(
            "The network is larger than %(limit_mb)s MB, this site's limit. Store its weights once, "
            "as 32-bit floats, train a smaller network, or ask an operator for more."
        ),
    },
)

register(
    "The network",
    invalid={
        "onnx_corrupt": _(
            "The ONNX file is damaged, incomplete or has unknown parts. Export it again, without appended data."
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
        "onnx_attribute": _(
            "The operator %(operator)s has an attribute that is not allowed here (%(attribute)s). "
            "Location: %(where)s. Export the network in evaluation mode, after policy.eval()."
        ),
        "onnx_external_data": _(
            "The external weights of the ONNX file cannot be found %(problem)s. Export it again; "
            "torch.onnx.export(..., external_data=False) writes a single file."
        ),
        "onnx_external_missing": _(
            "The weights of the ONNX file are in %(file)s, which is missing from the upload. Upload "
            "both files, a zip of both, or export with torch.onnx.export(..., external_data=False)."
        ),
        "onnx_tensor": _(
            "A weight tensor is inconsistent: its shape, type and stored bytes do not match. Export the network again."
        ),
        "onnx_tensor_type": _("Tensors of type %(type)s are not allowed. Export the network with 32-bit floats."),
        "onnx_graph": _("The ONNX graph is invalid (%(problem)s). Export it again."),
        "onnx_dynamic": _(
            "Every size in the network must be fixed for a batch of one. Export it with an example input of that size "
            "and without dynamic_axes (or dynamic_shapes)."
        ),
    },
    too_large={
        "onnx_too_big": _(
            "The ONNX file has too many parts (%(part)s, limit %(limit)s). Export the policy network alone."
        ),
    },
)
