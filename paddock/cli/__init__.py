"""The command ``paddock``, for racing from home: it calls a site's API and drives with this engine."""

# Reading order: :mod:`.main`, :mod:`.commands` (all commands and options), :mod:`.settings` (site and token),
# :mod:`.site` (one request and its answer), then the commands: :mod:`.looking`,
# :mod:`.sending`, :mod:`.downloads`, :mod:`.rehearsing`, :mod:`.proving`, :mod:`.starting`, :mod:`.models`,
# :mod:`.runs`, :mod:`.train`. :mod:`.folders` calls a command for each model of a folder. :mod:`.pinned` starts a
# command that drives anew, with the site's arithmetic.

from . import reasons as reasons  # registers its codes
