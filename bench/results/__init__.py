"""What the bundled garments cost on this machine, beside their errors and the goals."""
