"""Policies of stable-baselines3 as uploads: from the weights in ``policy.pth`` to ONNX, rebuilt from their shapes.

Of the zip that ``model.save`` writes two members are read: ``policy.pth`` by ``torch.load(weights_only=True)``, and
``data`` as plain JSON, whose base64 fields (pickled Python) stay closed. Both only in the sandbox, in a process of
their own (:mod:`.process`).
"""

from . import reasons as reasons  # registers its codes
