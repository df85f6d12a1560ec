"""Every reason code, whose fault it is, and the sentence a racer reads. No Django here.

The sentence says what is wrong and what to do. ``%(name)s`` placeholders come from the error's params.
``gettext_noop`` only marks the text for translation; pages translate it when they show it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


def gettext_noop(text: str) -> str:
    """Mark a text for ``makemessages`` without importing Django."""
    return text


@dataclass(frozen=True)
class Reason:
    """One reason code. ``fault`` is ``"user"`` or ``"platform"``."""

    code: str
    fault: str
    sentence: str

    def render(self, params: dict[str, Any], sentence: str | None = None) -> str:
        """The sentence (or its translation ``sentence``) with ``params`` filled in; a missing one shows as ``?``."""
        return (sentence or self.sentence) % _Params(params)


class _Params(dict):
    def __missing__(self, key: str) -> str:
        return "?"


def _table(fault: str, sentences: dict[str, str]) -> dict[str, Reason]:
    return {code: Reason(code, fault, sentence) for code, sentence in sentences.items()}


_ = gettext_noop

# --- upload ---------------------------------------------------------------------------------------------------------
_UPLOAD = _table(
    "user",
    {
        "empty": _("The file is empty. Choose the model's file again and upload it."),
        "too_large": _(
            "The upload is larger than %(limit_mb)s MB. A car's archive is about 22 MB; leave out checkpoints, "
            "logs and videos."
        ),
        "model_too_large": _(
            "The network is larger than %(limit_mb)s MB. Train a smaller one, or store its weights as 32-bit "
            "floats once only."
        ),
        "not_a_model": _(
            "This is not a model. Upload the car's model.tar.gz, or an .onnx file together with its "
            "model_metadata.json."
        ),
        "upload_parts": _(
            "These files do not belong together. Upload one archive, or one .onnx file and one model_metadata.json."
        ),
        "model_missing": _(
            "There is no network in the upload. A car's archive holds agent/model.pb; a zip holds one .onnx file."
        ),
        "metadata_missing": _(
            "model_metadata.json is missing. Add it: it says which actions the network chooses from and which "
            "sensors it reads."
        ),
        "unexpected_member": _(
            "The archive holds something that no car needs: %(member)s. Pack agent/model.pb (or one .onnx "
            "file) and model_metadata.json only."
        ),
        "duplicate_member": _(
            "The archive holds %(member)s more than once, so it is not clear which one is meant. Pack it again."
        ),
        "too_many_members": _(
            "The archive holds more than %(limit)s files. Pack the network and model_metadata.json only."
        ),
        "archive_corrupt": _("The archive is damaged or incomplete. Download or pack it again, then upload it."),
        "archive_unsupported": _(
            "The archive uses a feature that is not accepted here (encryption, zip64 or a rare compression). "
            "Pack it as an ordinary .tar.gz or .zip."
        ),
        "archive_overlap": _(
            "Files in the archive lie on top of each other, as in a zip bomb. Pack it again with an ordinary tool."
        ),
        "expanded_size": _(
            "The archive unpacks to far more than a car needs. Pack the network and model_metadata.json only."
        ),
        "garage_full": _(
            "Your garage holds %(limit)s models, which is the most it can. Delete one that you no longer race."
        ),
        "model_name_missing": _("The model needs a name with at least one visible character."),
        "model_name_too_long": _("The name is longer than %(limit)s characters. Choose a shorter one."),
        "model_name_taken": _("You already have a model named %(name)s. Choose another name."),
        "description_too_long": _("The description is longer than %(limit)s characters. Shorten it."),
        "model_not_yours": _("This model is not in your garage. Choose one of your own, or upload it first."),
    },
)

# --- metadata -------------------------------------------------------------------------------------------------------
_METADATA = _table(
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
    },
)

# --- conversion -----------------------------------------------------------------------------------------------------
_CONVERSION = _table(
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

# --- gate -----------------------------------------------------------------------------------------------------------
_GATE = _table(
    "user",
    {
        "onnx_corrupt": _(
            "The ONNX file is damaged, incomplete or has unknown parts. Export it again; nothing may be appended to it."
        ),
        "onnx_too_big": _(
            "The ONNX file has too many parts (%(part)s, limit %(limit)s). Export the policy network alone."
        ),
        "onnx_opset": _(
            "The ONNX file must use the standard operator set, version %(low)s to %(high)s. Export it with "
            "another opset_version."
        ),
        "onnx_domain": _(
            "The network uses an operator set that is not part of standard ONNX (%(domain)s). Export it "
            "without custom operators."
        ),
        "onnx_functions": _(
            "The ONNX file defines functions, training information or sparse weights. Export a plain inference graph."
        ),
        "onnx_operator": _(
            "The operator %(operator)s is not allowed in a car's network. Use plain layers: convolution, "
            "dense, pooling, activations."
        ),
        "onnx_attribute": _(
            "The operator %(operator)s has an attribute that is not allowed here (%(attribute)s). Export the "
            "network again."
        ),
        "onnx_external_data": _(
            "The weights are stored outside the ONNX file. Save them inside it (save_as_external_data=False)."
        ),
        "onnx_tensor": _(
            "A weight tensor contradicts itself: its shape, type and stored bytes do not fit. Export the network again."
        ),
        "onnx_tensor_type": _("Tensors of type %(type)s are not allowed. Export the network with 32-bit floats."),
        "onnx_graph": _("The ONNX graph is not well formed (%(problem)s). Export it again."),
        "onnx_dynamic": _(
            "Every size in the network must be fixed for a batch of one. Export it with fixed input sizes."
        ),
        "onnx_inputs": _(
            "The network's inputs are %(found)s but model_metadata.json names the sensors %(expected)s. Name "
            "each input as its sensor."
        ),
        "onnx_input_type": _("The input %(sensor)s must be %(expected)s."),
        "onnx_input_shape": _("The input %(sensor)s has the shape %(found)s; it must be %(expected)s."),
        "onnx_output": _(
            "The network must have one 32-bit float output of shape [1, %(expected)s] to fit the action space; "
            "it has %(found)s."
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

# --- run time -------------------------------------------------------------------------------------------------------
_RUN_TIME = _table(
    "user",
    {
        "non_finite_action": _(
            "The network answered NaN or infinity in step %(step)s. Check its weights and train it again."
        ),
        "policy_late": _(
            "The network was too slow: in step %(step)s its time was used up (%(step_s)s s for a step, %(overage_s)s s "
            "to spare in all, %(total_s)s s for the whole run). Train a smaller network."
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

# --- platform -------------------------------------------------------------------------------------------------------
_PLATFORM = _table(
    "platform",
    {
        "sandbox_unavailable": _(
            "This host cannot wall off models safely enough (level %(level)s, at least %(minimum)s is needed), so none "
            "is run. An operator sees with “manage.py doctor” what is missing."
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
        "internal_error": _("Paddock made a mistake. Nothing is wrong with your model; it will be tried again."),
        "storage_failed": _(
            "A stored file could not be read or written. Nothing is wrong with your model; it will be tried again."
        ),
        "lease_expired": _("The worker that ran this evaluation disappeared. It will be tried again."),
        "platform_gave_up": _(
            "Paddock failed to run this model %(attempts)s times. Nothing is wrong with it and the attempt does not "
            "count: submit it again later."
        ),
    },
)

# --- tracks ---------------------------------------------------------------------------------------------------------
_TRACKS = _table(
    "user",
    {
        "track_not_npy": _("This is no NumPy array file (.npy), or it is cut short. Save the track with numpy.save."),
        "track_pickled": _(
            "The file holds pickled Python objects, which are never opened. Save a plain float64 array with numpy.save."
        ),
        "track_file_too_large": _("The track file is larger than %(limit_mb)s MB. Send fewer points."),
        "track_shape": _(
            "The track must be a table of six number columns (centre x, y, inner x, y, outer x, y); this is %(shape)s."
        ),
        "track_not_finite": _("Row %(row)s holds NaN or infinity. Every point needs real coordinates in metres."),
        "track_far_away": _(
            "The track has points more than %(limit_m)s m from the origin. Move it there; coordinates are in metres."
        ),
        "track_too_few_points": _(
            "The track has only %(points)s distinct points; it needs at least %(limit)s. Sample it more finely."
        ),
        "track_too_large": _("The track has %(points)s points, more than %(limit)s. Sample it less finely."),
        "track_open": _(
            "The track is open: its last point is %(gap_m)s m from its first. A race needs a closed loop; "
            "repeat the first point at the end."
        ),
        "track_too_short": _(
            "The track is %(length_m)s m long, shorter than %(limit_m)s m. Coordinates are in metres: scale it up."
        ),
        "track_too_long": _(
            "The track is %(length_m)s m long, longer than %(limit_m)s m. Coordinates are in metres: scale it down."
        ),
        "track_turns_back": _(
            "The centre line turns by %(degrees)s degrees at waypoint %(row)s. Round that corner with more points."
        ),
        "track_self_crossing": _(
            "The centre line crosses itself between waypoints %(row)s and %(other_row)s. A track may not cross itself."
        ),
        "track_too_narrow": _(
            "The road is %(width_m)s m wide at waypoint %(row)s, less than %(limit_m)s m. Move the borders apart."
        ),
        "track_too_wide": _(
            "The borders are %(width_m)s m apart at waypoint %(row)s, more than %(limit_m)s m. Each row must "
            "hold a centre point and the two border points across the road from it."
        ),
        "track_borders_cross": _(
            "The %(line)s (waypoint %(row)s) crosses the %(other_line)s (waypoint %(other_row)s). The borders "
            "may cross neither each other nor themselves nor the centre line."
        ),
        "track_borders_apart": _(
            "The borders do not enclose the centre line. One border must lie inside the loop and one outside it."
        ),
    },
)

# --- race -----------------------------------------------------------------------------------------------------------
_RACE = _table(
    "user",
    {
        # a race that is made or changed
        "race_field": _("%(field)s cannot be so: %(problem)s"),
        "race_field_fixed": _("%(field)s never changes once a race is made. Make another race instead."),
        "race_closes_before_opening": _(
            "The race closes before it opens. Choose a closing time after the opening time."
        ),
        "race_opens_in_the_past": _("The opening time has passed. Choose now or a later time."),
        "race_already_over": _("The closing time has passed. Choose a later one."),
        "race_too_long": _("A race lasts at most %(days)s days. Choose an earlier closing time."),
        "race_too_far_ahead": _("The race opens more than %(days)s days from now. Choose an earlier time."),
        "race_minimum_laps": _(
            "The car drives %(laps)s laps, so at most %(laps)s consecutive laps can be asked of it."
        ),
        "race_total_needs_all_laps": _(
            "For the total time every lap counts: ask for %(laps)s complete laps, as many as are driven."
        ),
        "race_sensors": _("A race offers one or more of these sensors, each once: %(known)s."),
        "race_needs_division": _("A league race belongs to a division. Choose open or pro."),
        "race_league_is_public": _("A league race is public. Only community races can be by invitation."),
        "race_community_has_no_division": _("Divisions belong to league races. Leave the division empty."),
        "race_limit": _(
            "You already hold %(limit)s races that are not over. Wait until one closes, or cancel one of them."
        ),
        "race_has_opened": _("The race has opened, so its opening time no longer changes."),
        "race_is_over": _("The race is over: only its name and its description can be changed."),
        "race_has_submissions": _(
            "Cars have already been submitted under these rules, so they no longer change. Make another race instead."
        ),
        "cancel_needs_a_reason": _("Say why the race is cancelled: everybody who entered will read it."),
        "race_not_yours": _("Only the organiser of this race and admins can do this."),
        # getting in and out
        "race_not_open_yet": _("The race opens at %(opens)s. Submit a car from then on."),
        "race_closed": _("The race closed at %(closes)s. Its entries and cars do not change any more."),
        "race_cancelled": _("The race was cancelled: %(reason)s"),
        "race_needs_invitation": _("This race is by invitation. Open the link that its organiser gave you."),
        "invitation_unknown": _(
            "This invitation link is not valid any more. Ask the organiser of the race for the present one."
        ),
        "race_pro_only": _(
            "This is a race of the pro division. The best of each month's open race are promoted to it: enter that one."
        ),
        "race_open_only": _(
            "You are in the pro division this season, so this month's pro race is yours, not this one."
        ),
        "entry_missing": _("You have not entered this race."),
        "entry_withdrawn": _("You have withdrawn from this race. Enter it again first."),
        "entry_removed": _("The organiser has removed you from this race. Ask them if you take it for a mistake."),
        # submitting
        "sensors_not_offered": _(
            "The model reads %(needed)s, which this race does not offer. It offers %(offered)s: choose a model that "
            "was trained with these."
        ),
        "car_already_submitted": _(
            "You have already sent this very car to this race. The same car gives the same result, so that one stands."
        ),
        "submission_running": _("Your last car is still being timed. Wait for its result, or stop it."),
        "submissions_used_up": _("You have used all %(limit)s submissions that this race allows."),
        "submission_not_failed": _("Only a run that failed or was stopped can be repeated; this one stands."),
        # tracks that racers import
        "track_known": _("This very track is here already, as %(name)s. Use that one."),
        "track_limit": _(
            "You have imported %(limit)s tracks, as many as one racer may. Race on one of those here, or ask an admin."
        ),
        "track_name": _("Give the track a name of 1 to %(limit)s characters on one line."),
        "track_slug": _(
            "The address %(slug)s cannot be used. Use lower-case letters, digits and hyphens; it must be new."
        ),
        "track_in_use": _("Races or evaluations were driven on this track, so it stays."),
    },
)

# --- account --------------------------------------------------------------------------------------------------------
_ACCOUNT = _table(
    "user",
    {
        "too_many_tokens": _("You have %(limit)s API tokens already. Revoke one that you no longer need."),
    },
)

REASONS: dict[str, Reason] = {
    **_UPLOAD,
    **_METADATA,
    **_CONVERSION,
    **_GATE,
    **_RUN_TIME,
    **_PLATFORM,
    **_TRACKS,
    **_RACE,
    **_ACCOUNT,
}
