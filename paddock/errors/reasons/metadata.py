"""What is wrong with a model_metadata.json."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
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
