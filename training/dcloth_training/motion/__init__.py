"""Motion: the humanoid skeleton, BVH clips, procedural clips and their timing."""
