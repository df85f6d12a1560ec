"""Golden runs: a table of an engine's results, so that no result changes unnoticed.

``python -m training.golden`` drives them and compares them with the present engine's table (``tables/ENGINE.json``);
``--write`` writes the table of a new one; old tables stay. ``--bare`` drives in one process without the sandbox, as
under an emulator of other processors (:mod:`.processors`). Workers prove their exactness by a few of them
(:mod:`.proof`).
"""
