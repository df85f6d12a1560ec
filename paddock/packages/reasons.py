"""Why an upload is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Upload",
    "user",
    {
        "empty": _("The file is empty. Choose the model's file again and upload it."),
        "too_large": _(
            "The upload is larger than %(limit_mb)s MB. A car needs its network and model_metadata.json only: if "
            "there are checkpoints (.ckpt), logs or videos in it, leave them out."
        ),
        "not_a_model": _(
            "This is not a model. Upload a model.tar.gz, or an .onnx file together with its model_metadata.json."
        ),
        "upload_parts": _(
            "These files do not belong together. Upload one archive, or one network with its model_metadata.json (and, "
            "of an .onnx file that keeps its weights outside, the .onnx.data file)."
        ),
        "model_missing": _(
            "There is no network in the upload. A model's archive holds agent/model.pb, a training's folder "
            "model/model_<iteration>.pb, a zip one .onnx file."
        ),
        "metadata_missing": _(
            "model_metadata.json is missing. Add it: it says which actions the network chooses from and which "
            "sensors it reads."
        ),
        "torch_file": _(
            "This is a file of Python objects, as PyTorch writes them (.pt, .pth): it is not opened here. Upload the "
            "zip that model.save() of stable-baselines3 writes, or export the network with torch.onnx.export() and "
            "upload the .onnx file; each with its model_metadata.json."
        ),
        "sb3_metadata_missing": _(
            "This is a zip of stable-baselines3. Add model_metadata.json, beside it or in it: it says which sensors "
            "the policy reads and what its actions mean, which the zip does not."
        ),
        "unexpected_member": _(
            "The archive holds something other than plain files in folders: %(member)s. Pack it again with plain "
            "files, and with names that do not lead out of it."
        ),
        "several_networks": _(
            "The archive holds more than one network (%(members)s), so it is not clear which one shall race. Pack "
            "one of them."
        ),
        "training_folder_incomplete": _(
            "This is a training's folder, and %(missing)s is missing from it: checkpoints (.ckpt) alone cannot be "
            "read. Pack the folder again with it, or upload the model's own archive."
        ),
        "checkpoint_missing": _(
            "There is no checkpoint %(checkpoint)s in the upload. It holds: %(found)s. Choose one of these, or "
            "leave the choice empty."
        ),
        "checkpoints_unreadable": _(
            "deepracer_checkpoints.json does not say which checkpoint is the best (%(problem)s). Choose a checkpoint "
            "by its number or as last, or leave that file out."
        ),
        "duplicate_member": _(
            "The archive holds %(member)s more than once, so it is not clear which one is meant. Pack it again."
        ),
        "too_many_members": _("The archive holds more than %(limit)s files. Leave out logs and traces."),
        "archive_corrupt": _("The archive is damaged or incomplete. Download or pack it again, then upload it."),
        "archive_unsupported": _(
            "The archive uses a feature that is not accepted here (encryption, more than 65,534 files, or a rare "
            "compression). Pack it as an ordinary .tar.gz or .zip."
        ),
        "archive_overlap": _(
            "Files in the archive lie on top of each other, as in a zip bomb. Pack it again with an ordinary tool."
        ),
        "expanded_size": _(
            "The archive unpacks to far more than a car or its training needs. Pack the network and "
            "model_metadata.json only."
        ),
        "sb3_at_home": _(
            "This is a zip of stable-baselines3, which a site converts and the engine alone does not. Upload it, "
            "download the model again as ONNX, or export it yourself."
        ),
    },
)

register(
    "model_metadata.json",
    "user",
    {
        "metadata_too_large": _(
            "model_metadata.json is larger than %(limit_kb)s kB. It needs the action space and the sensors only."
        ),
        "metadata_not_json": _(
            "model_metadata.json is not valid JSON (%(line)s: %(problem)s). Compare it with a file written by "
            "the console."
        ),
        "metadata_not_object": _("model_metadata.json must be one JSON object in braces with the key action_space."),
        "metadata_duplicate_key": _("model_metadata.json has the key %(key)s twice in one object. Keep one of them."),
        "metadata_action_space_missing": _(
            "model_metadata.json has no action_space. Add the list of actions or the ranges the network was "
            "trained with."
        ),
        "metadata_action_space_type": _(
            "action_space_type must be discrete or continuous, and action_space must be a list for the one and "
            "an object for the other."
        ),
        "metadata_action_space_empty": _(
            "The action space has no actions. Add the actions the network was trained with."
        ),
        "metadata_too_many_actions": _(
            "The action space has %(count)s actions; at most %(limit)s are possible. Use the list the network "
            "was trained with."
        ),
        "metadata_action": _("Action %(index)s needs the keys steering_angle (degrees) and speed (m/s)."),
        "metadata_action_value": _(
            "%(key)s must be a finite number between -1000 and 1000. Correct it in model_metadata.json."
        ),
        "metadata_action_range": _(
            "The continuous action space needs low and high for %(key)s, and low must be less than high."
        ),
        "metadata_sensor": _(
            "sensor must be a list of names such as FRONT_FACING_CAMERA; this name is not known: %(sensor)s."
        ),
        "metadata_sensor_set": _(
            "A car has exactly one camera (FRONT_FACING_CAMERA, LEFT_CAMERA, STEREO_CAMERAS or observation) "
            "and at most one lidar, each named once."
        ),
        "metadata_network": _("neural_network must be one of %(known)s."),
        "metadata_algorithm": _(
            "training_algorithm must be clipped_ppo or sac, and sac drives a continuous action space only."
        ),
        "metadata_version": _("version must be a number from 1 to 6."),
        "metadata_lidar": _(
            "lidar_config does not make sense: %(key)s. num_sectors divides 64, num_values_per_sector is 1 to "
            "64, clipping_dist is 0.15 to 12 m."
        ),
        "metadata_lidar_sectors": _(
            "lidar_config asks for %(sectors)s sectors, among which the 64 beams cannot be shared out evenly. "
            "Set num_sectors to 1, 2, 4, 8, 16, 32 or 64, as the model was trained."
        ),
    },
)

register(
    "Conversion of a TensorFlow graph",
    "user",
    {
        "graph_unreadable": _(
            "The file model.pb is not a frozen TensorFlow graph or is damaged. Use agent/model.pb from the "
            "model's own archive."
        ),
        "graph_too_big": _(
            "The TensorFlow graph has too many parts (limit %(limit)s). Upload the frozen graph "
            "agent/model.pb, not a training graph."
        ),
        "graph_not_frozen": _(
            "The graph has weights that are not stored in it (%(node)s). Upload the frozen graph "
            "agent/model.pb from the model's archive."
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
            "model's own archive."
        ),
    },
)

register(
    "The network",
    "user",
    {
        "onnx_operator": _(
            "The operator %(operator)s is not allowed in a model's network (%(layer)s). It stands at: %(where)s. Use "
            "plain layers: convolution, dense, pooling, activations."
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
        "network_fails": _(
            "The network does not run: the inference engine refused it. Export it again with a current tool."
        ),
        "network_non_finite": _(
            "The network answers NaN or infinity to an ordinary picture. Use an earlier checkpoint."
        ),
        "non_finite_weights": _(
            "The network has weights that are NaN or infinite, so its training broke. Use an earlier checkpoint."
        ),
    },
)

register(
    "Downloads",
    "user",
    {
        "export_operator": _(
            "The network cannot be written in this format: its operator %(operator)s (%(where)s) has no like there. "
            "Download the ONNX package, which holds every network."
        ),
    },
)
