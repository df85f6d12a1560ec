"""The reasons for which an upload is refused."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Upload",
    invalid={
        "empty": _("The file is empty. Choose the model's file again and upload it."),
        "not_a_model": _(
            "This is not a model. Upload a model.tar.gz or a .zip (.rar and .7z are not read), or an .onnx file "
            "together with its model_metadata.json."
        ),
        "upload_parts": _(
            "These files cannot be combined. Upload one archive, or one network with its "
            "model_metadata.json (and the .onnx.data file if the .onnx file has external weights)."
        ),
        "model_missing": _(
            "The upload contains no network. Found: %(found)s. Expected: agent/model.pb in a model archive, "
            "model/model_<iteration>.pb in a training folder, or one .onnx file in a zip."
        ),
        "metadata_missing": _(
            "model_metadata.json is missing. Found: %(found)s. Add it: it lists the actions and sensors of the network."
        ),
        "network_format": _(
            "%(member)s is a network in %(format)s format, which cannot be read here. Upload the model.pb or .onnx "
            "file that it was made from."
        ),
        "torch_file": _(
            "PyTorch files (.pt, .pth) contain Python objects and are not accepted. Upload the zip "
            "written by model.save() of stable-baselines3, or the .onnx file written by "
            "torch.onnx.export(), with its model_metadata.json."
        ),
        "sb3_metadata_missing": _(
            "This is a zip of stable-baselines3. Add model_metadata.json beside it or in it, with "
            "the sensors and actions of the policy."
        ),
        "unexpected_member": _(
            "The archive contains something other than plain files in folders: %(member)s. Pack "
            "plain files only, with paths inside the archive."
        ),
        "several_networks": _("The archive contains several networks (%(members)s). Pack only one."),
        "training_folder_incomplete": _(
            "This training folder lacks %(missing)s. Checkpoints (.ckpt) alone cannot be read. Pack "
            "the folder again with it, or upload the model archive."
        ),
        "checkpoint_missing": _(
            "The upload has no checkpoint %(checkpoint)s. Available: %(found)s. Choose one of these, "
            "or leave the choice empty."
        ),
        "checkpoints_unreadable": _(
            "deepracer_checkpoints.json names no best checkpoint (%(problem)s). Choose a checkpoint "
            "by number or as last, or remove that file."
        ),
        "duplicate_member": _("The archive contains %(member)s more than once. Pack it again with one copy."),
        "too_many_members": _("The archive contains more than %(limit)s files. Leave out logs and traces."),
        "archive_corrupt": _("The archive is damaged or incomplete. Download or pack it again, then upload it."),
        "archive_unsupported": _(
            "The archive uses a feature that is not accepted here (encryption, more than 65,534 files, or a rare "
            "compression). Pack it as an ordinary .tar.gz or .zip."
        ),
        "archive_overlap": _("Files in the archive overlap, as in a zip bomb. Pack it again with a standard tool."),
        "sb3_at_home": _(
            "Zips of stable-baselines3 can only be converted by a site. Upload it and download the "
            "model as ONNX, or export it yourself."
        ),
    },
    too_large={
        "too_large": _(
            "The upload is larger than %(limit_mb)s MB. A car needs its network and model_metadata.json only: if "
            "there are checkpoints (.ckpt), logs or videos in it, leave them out."
        ),
        "expanded_size": _("The archive is too large when unpacked. Pack the network and model_metadata.json only."),
    },
)

register(
    "Paddock's own faults",
    unavailable={
        "sb3_needs_torch": _(
            "This site cannot read zips of stable-baselines3: PyTorch is not installed on it. Export the policy "
            "with torch.onnx.export() and upload the .onnx file, or ask the site's operator for training."
        ),
    },
)

register(
    "model_metadata.json",
    invalid={
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
        "metadata_sensor": _("sensor must be a list of names such as FRONT_FACING_CAMERA. Unknown name: %(sensor)s."),
        "metadata_sensor_set": _(
            "A car has exactly one camera (FRONT_FACING_CAMERA, LEFT_CAMERA, STEREO_CAMERAS or observation) "
            "and at most one lidar, each named once."
        ),
        "metadata_network": _("neural_network must be a name. Write it in quotation marks, or leave the key out."),
        "metadata_algorithm": _(
            "training_algorithm must be clipped_ppo or sac, and sac drives a continuous action space only."
        ),
        "metadata_version": _("version must be a number from 1 to 6."),
        "metadata_lidar": _(
            "Invalid lidar_config: %(key)s. num_sectors divides 64, num_values_per_sector is 1 to "
            "64, clipping_dist is 0.15 to 12 m."
        ),
        "metadata_lidar_sectors": _(
            "lidar_config has %(sectors)s sectors, which do not divide the 64 beams evenly. Set "
            "num_sectors to 1, 2, 4, 8, 16, 32 or 64, as in training."
        ),
        "metadata_frame_stack": _(
            "frame_stack must be a whole number from 1 to %(limit)s: how many observations the network reads at once."
        ),
    },
    too_large={
        "metadata_too_large": _(
            "model_metadata.json is larger than %(limit_kb)s kB. It only needs the action space and the sensors."
        ),
    },
)

register(
    "Conversion of a TensorFlow graph",
    invalid={
        "graph_unreadable": _(
            "model.pb is damaged or not a frozen TensorFlow graph. Use agent/model.pb from the model archive."
        ),
        "graph_not_frozen": _(
            "The graph lacks stored weights (%(node)s). Upload the frozen graph agent/model.pb from the model archive."
        ),
        "graph_operation": _(
            "The TensorFlow operation %(operation)s cannot be converted (%(node)s). Export the network to ONNX "
            "yourself and upload that."
        ),
        "graph_output": _(
            "No policy output was found in the graph. It must end in ppo_head_0/policy or sac_policy_head_0/policy."
        ),
        "graph_inputs": _(
            "The graph reads %(found)s; model_metadata.json lists the sensors %(expected)s. Upload "
            "both files from the same training."
        ),
        "graph_invalid": _(
            "The graph is inconsistent at %(node)s: sizes or types do not match. Use agent/model.pb "
            "from the model archive."
        ),
    },
    too_large={
        "graph_too_big": _(
            "The TensorFlow graph has too many parts (limit %(limit)s). Upload the frozen graph "
            "agent/model.pb, not a training graph."
        ),
    },
)

register(
    "The network",
    invalid={
        "onnx_operator": _(
            "The operator %(operator)s is not allowed in a model's network (%(layer)s). Location: "
            "%(where)s. Use plain layers: convolution, dense, pooling, activations."
        ),
        "onnx_inputs": _(
            "The network's inputs are %(found)s; model_metadata.json lists the sensors %(expected)s. "
            "Name each input after its sensor: torch.onnx.export(..., input_names=[...])."
        ),
        "onnx_input_type": _("The input %(sensor)s must be %(expected)s."),
        "onnx_input_shape": _(
            "The input %(sensor)s has the shape %(found)s; it must be %(expected)s. Use an example "
            "input of this shape in torch.onnx.export."
        ),
        "onnx_output": _(
            "The action space needs one 32-bit float output of shape [1, %(expected)s]; the network "
            "returns %(found)s. Return the logits (or the two actions) from forward(), and compare "
            "action_space with the training."
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
        "network_fails": _("The inference engine cannot run the network. Export it again with a current tool."),
        "network_non_finite": _(
            "The network returns NaN or infinity for an ordinary picture. Use an earlier checkpoint."
        ),
        "non_finite_weights": _("Some weights are NaN or infinite: the training diverged. Use an earlier checkpoint."),
    },
)

register(
    "Downloads",
    invalid={
        "export_operator": _(
            "This format has no equivalent of the operator %(operator)s (%(where)s). Download the ONNX package instead."
        ),
        "export_frame_stack": _(
            "This network reads the last %(count)s observations at once (frame_stack). Programs that read this format "
            "give it one at a time. Download the ONNX package instead."
        ),
    },
)
