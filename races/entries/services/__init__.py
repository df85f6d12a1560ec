"""Every write to entries, submissions and standings.

Rows are locked in the order evaluation, entry, race; a writer that holds an entry or a race stops evaluations after the
commit.
"""
