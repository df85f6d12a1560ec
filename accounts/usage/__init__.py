"""How much of the site's quotas and storage racers use."""
