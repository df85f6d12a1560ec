"""What the site asks of its databases: the clock, locks, columns, constraints, migrations, a cache per commit."""
