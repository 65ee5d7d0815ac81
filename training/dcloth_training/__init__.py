"""dcloth training: motion -> simulate -> dataset -> network -> train -> export -> metrics.

Run the steps as modules, with the folder `training` on PYTHONPATH:
`python3 -m dcloth_training.<step>`. Units are metres, seconds and radians; the world is
right-handed, +Y up, a character faces +Z and its left is +X; matrices act on column vectors.
"""
