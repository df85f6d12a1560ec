"""The command ``paddock``: race from home. It talks to a site over its API, and drives with the engine that it lies in.

Reading order: :mod:`.main` (what can be asked), :mod:`.settings` (which site, whose token), :mod:`.site` (one request
and what may come of it), then the commands: :mod:`.looking`, :mod:`.sending`, :mod:`.rehearsing`, :mod:`.proving`,
:mod:`.starting`.
"""

from . import reasons as reasons  # registers its codes
