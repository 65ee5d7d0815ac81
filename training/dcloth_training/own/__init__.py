"""A character and a garment of the user's own, as the cloth solver needs them."""
