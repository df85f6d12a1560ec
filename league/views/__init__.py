"""The league's own pages: home, racers, account, how it works, health."""
