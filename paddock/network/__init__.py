"""A model's network as numbers: read and written without a library, brought into one form, computed exactly.

No Django, no runtime: the policy process, the admission and whoever compares with them use it. What a network may be is
decided in :mod:`paddock.packages.gate`.
"""

from . import reasons as reasons  # registers its codes
