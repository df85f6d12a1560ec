"""Reason codes of stable-baselines3 policies that cannot become ONNX."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Policies of stable-baselines3",
    invalid={
        "sb3_unreadable": _(
            "%(member)s in this zip of stable-baselines3 cannot be read. Save the model again with model.save() of a "
            "current version and upload that."
        ),
        "sb3_custom": _(
            "This policy of stable-baselines3 uses %(what)s, which cannot be rebuilt from its weights. Export it with "
            "torch.onnx.export() and upload the .onnx file."
        ),
        "sb3_layer": _(
            "%(layer)s has no place in a policy of stable-baselines3 as it is built for these sensors. Check "
            "model_metadata.json, or export the policy with torch.onnx.export() and upload the .onnx file."
        ),
        "sb3_observation": _(
            "The policy was trained on %(found)s; the sensors in model_metadata.json give %(expected)s. What a wrapper "
            "did to the picture (such as resizing) is not in the zip: export the policy with it to ONNX."
        ),
        "sb3_frame_stack": _(
            "The policy was trained on the last %(count)s observations at once (VecFrameStack). At most %(limit)s are "
            "possible: train it with fewer."
        ),
        "sb3_channels": _(
            "The policy was trained on %(count)s channels, and %(sensor)s has one. They may be stacked frames or "
            'colours. If they are frames of VecFrameStack, write "frame_stack": %(count)s into model_metadata.json; if '
            'they are the colours of deepracer-v0, write "colour": true. A policy on other colours must be exported to '
            "ONNX, with the conversion from one channel inside."
        ),
        "sb3_actions": _(
            "The policy answers %(found)s values, the action space in model_metadata.json needs %(expected)s. Upload "
            "the file that it was trained with."
        ),
        "sb3_action_space": _(
            "The policy was trained to answer %(found)s. Here continuous actions are from -1 to 1, which "
            "model_metadata.json scales to degrees and m/s: train it with such actions."
        ),
    },
)
