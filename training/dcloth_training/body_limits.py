"""What skin a model can keep cloth out of: limits of the format (engine/format/limits.h), counted as the converter
does."""
import numpy as np
from scipy.spatial import cKDTree

REACH = 0.5     # metres from the template
VERTICES, FACES, RING = 8192, 16384, 32


def excess(vertices, faces, collider, template, touches=None, parts=None):
    """Why the colliding skin near the garment is more than a model holds, or None. touches, parts: rig.Character."""
    near = cKDTree(template).query(vertices, distance_upper_bound=REACH)[0] < REACH
    kept = faces[np.asarray(collider, bool)[faces].all(1) & near[faces].any(1)]
    if touches is not None:
        kept = kept[np.any([(parts[kept] & mask != 0).all(1) for mask in np.unique(touches)], axis=0)]
    around = np.bincount(kept.ravel(), minlength=1)
    count = int((around > 0).sum())
    if count > VERTICES or len(kept) > FACES:
        found = f"{count:,} vertices and {len(kept):,} faces"
    elif around.max() > RING:
        found = f"{around.max()} faces around vertex {around.argmax()}"
    else:
        return None
    return (f"{found} of the body collide near the garment; a model holds {VERTICES:,}, {FACES:,} and {RING} around a "
            "vertex, so cloth cannot be kept outside of this body (DCLOTH_OUTPUT_OUTSIDE_BODY)")
