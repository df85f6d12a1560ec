"""The training itself, in a process of its own in the sandbox: :mod:`.process` is what runs there.

No Django. :mod:`.spec` says what a training is, :mod:`.client` starts one and listens to it; both import no torch, as
the workers that use them must not. The reward function is a stranger's Python, so everything that comes out of the
process is believed as little as an upload: :mod:`.client` checks sizes, types and ranges.
"""
