"""Results, certificates, highlights and the replay of a live event after its end."""
