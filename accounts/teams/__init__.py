"""Teams of racers."""
