"""The sandbox around untrusted code: probe, launch, lock and the frames that cross it. No Django.

Reading order: :mod:`.limits` (what a process may use), :mod:`.launch` (namespaces, files and pipes from outside),
:mod:`.enter` and :mod:`.lock` (what the process gives up itself), :mod:`.frames` (how one talks to it),
:mod:`.policy_process` and :mod:`.policy_client` (the two ends of a model's pipes), :mod:`.shown` (memory in which it is
shown what its car sees), :mod:`.probe` (what this host offers).
"""
