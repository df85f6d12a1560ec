"""The sandboxed process of a reward function and its client. Imports no Django.

Inside: :mod:`.function`, :mod:`.call_limits`, :mod:`.allowed_modules`, :mod:`.static_checks`, :mod:`.hints`,
:mod:`.process`. Outside: :mod:`.client`.
"""
