"""Teams: who may do what, and every write."""
