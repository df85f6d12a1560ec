"""Golden runs: a table of what an engine must come to, so that no result moves unseen.

``python -m training.golden`` drives them and compares them with the present engine's table (``tables/ENGINE.json``);
``--write`` writes the table of a new one. Tables of old engines stay, as history. ``--bare`` drives in one process
without the sandbox, which is also what runs under an emulator of other processors (:mod:`.processors`). A worker proves
by a few of them that it computes as every other (:mod:`.proof`).
"""
