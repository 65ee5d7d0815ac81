"""Ground truth: mannequin, garment, and the cloth simulation that drapes one on the other."""
