"""What is wrong with an upload before anybody looks at the network."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "empty": _("The file is empty. Choose the model's file again and upload it."),
        "too_large": _(
            "The upload is larger than %(limit_mb)s MB. A car needs its network and model_metadata.json only: if "
            "there are checkpoints (.ckpt), logs or videos in it, leave them out."
        ),
        "model_too_large": _(
            "The network is larger than %(limit_mb)s MB, the most that this site takes. Store its weights as 32-bit "
            "floats and once only, train a smaller one, or ask an operator for more."
        ),
        "not_a_model": _(
            "This is not a model. Upload the car's model.tar.gz, or an .onnx file together with its "
            "model_metadata.json."
        ),
        "upload_parts": _(
            "These files do not belong together. Upload one archive, or one network with its model_metadata.json (and, "
            "of an .onnx file that keeps its weights outside, the .onnx.data file)."
        ),
        "model_missing": _(
            "There is no network in the upload. A car's archive holds agent/model.pb, a training's folder "
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
            "The archive holds something that is no plain file in a folder: %(member)s. Pack it again with plain "
            "files, and with names that do not lead out of it."
        ),
        "several_networks": _(
            "The archive holds more than one network (%(members)s), so it is not clear which one shall race. Pack "
            "one of them."
        ),
        "training_folder_incomplete": _(
            "This is a training's folder, and %(missing)s is missing from it: checkpoints (.ckpt) alone cannot be "
            "read. Pack the folder again with it, or upload the car's own archive."
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
        "garage_full": _(
            "Your garage holds %(limit)s models, which is the most it can. Delete one that you no longer race."
        ),
        "storage_full": _(
            "What you have stored takes up %(limit_mb)s MB, which is the most that one racer may. Your usage page says "
            "what it is. Delete models and trainings that you need no more (networks that never raced are removed "
            "after a day); for more, ask an operator."
        ),
        "model_name_missing": _("The model needs a name with at least one visible character."),
        "model_name_too_long": _("The name is longer than %(limit)s characters. Choose a shorter one."),
        "model_name_taken": _("You already have a model named %(name)s. Choose another name."),
        "description_too_long": _("The description is longer than %(limit)s characters. Shorten it."),
        "model_look": _(
            "There is no such look. Choose the shell from %(known)s, and write the colour as #rrggbb, such as #3b82f6."
        ),
        "model_deleted_not_shared": _("A deleted model cannot be shared. Upload it again, or share another one."),
        "model_not_yours": _("This model is not in your garage. Choose one of your own, or upload it first."),
    },
)
