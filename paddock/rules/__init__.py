"""Every parameter that somebody chooses, each written once: its name, type, default, bounds, unit, label and help.

:mod:`.race` is the list of race rules, :mod:`.hyperparameters` that of a learner. Columns, forms, serializers, options
of commands, environments, facts on pages and the tables of the docs are made from them. No Django here.
"""
