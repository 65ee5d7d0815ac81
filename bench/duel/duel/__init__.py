"""The duel: simulation that games ship beside dcloth, on the same clips, core and budget."""
