"""Options of glibc's malloc, for processes that give memory back only to fetch it again."""

import ctypes

_NUMBERS = {"trim_threshold": -1, "top_pad": -2, "mmap_threshold": -3, "mmap_max": -4}  # malloc.h


def set_malloc_options(**options: int) -> None:
    """Set options of mallopt(3), by their names in small letters. Does nothing with another C library."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for name, value in options.items():
            mallopt(_NUMBERS[name], value)
