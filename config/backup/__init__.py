"""A whole site in one file, and back again: ``manage.py backup`` and ``manage.py restore``.

:mod:`.archive` is the file's form, :mod:`.databases` what SQLite and PostgreSQL do, :mod:`.files` the stored files,
:mod:`.making` and :mod:`.restoring` the order in which things must happen.
"""
