from faults.reasons import *  # noqa: F403
from faults.reasons import REASONS, Reason, gettext_noop  # noqa: F401
