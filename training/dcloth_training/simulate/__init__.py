"""Ground truth: garments, and the cloth simulation that drapes one on the other."""
