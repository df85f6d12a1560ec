"""What the commands have in common: their exit status for what they refuse, and for Paddock's own faults."""

REFUSED, OUR_FAULT = 2, 3
