"""The sandbox around untrusted code: probe, launch, lock and the frames that cross it. No Django.

Reading order: :mod:`.limits` (what a process may use), :mod:`.launch` and :mod:`.start` (namespaces, files and pipes),
:mod:`.process` (the running process), :mod:`.enter` and :mod:`.lock` (what it gives up itself), :mod:`.frames`
(messages), :mod:`.policy_process` and :mod:`.policy_client` (the two ends of a model's pipes),
:mod:`.observation_memory` (memory that shows it what its car sees), :mod:`.probe` (what this host offers).
"""
