"""The training itself, in a sandboxed process (:mod:`.process`).

No Django. :mod:`.spec` describes a training, :mod:`.client` starts one and checks its messages, which are untrusted
because the reward function is; both import no torch.
"""
