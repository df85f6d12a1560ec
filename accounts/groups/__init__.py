"""Groups of racers: who may see and do what, and every write."""
