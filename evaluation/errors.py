from faults import *  # noqa: F403
from faults import PaddockError, PlatformFault, UserFault, fault_from_dict  # noqa: F401
