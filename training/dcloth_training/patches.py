"""A garment cut into patches: strips that hang along the body, each with a few points, a frame and neighbours.

A patch is a column of cloth, such as a gore of a skirt, from its upper rim to its hem; a point is the mean of a part of
the column. Weights of the patch stage are shared by all patches, so each sees its cloth and the body in its own frame
(columns out, up, along). patch_cut makes a Layout; this module is what a Layout is good for.
"""
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix


@dataclass
class Layout:
    """Sizes: K patches of R points, n vertices, L mixing layers with S neighbours each; bind pose, metres."""
    points_of: csr_matrix               # [K R, n] rows are means
    patch_joint: np.ndarray             # [K] joint whose frame a patch has
    axes: np.ndarray                    # [K, 3, 3]
    centres: np.ndarray                 # [K, 3]
    point_joints: np.ndarray            # [K, R, 4]
    point_parts: np.ndarray             # [K, R, 4, 4]: mean of weight times place, mean weight
    limbs: np.ndarray                   # [K, 2, 2] capsules
    capsule_joints: np.ndarray          # [c]
    capsules: np.ndarray                # [c, 8]: both ends, both radii
    near: np.ndarray                    # [L, S, K]
    mirror: np.ndarray = field(default=None)    # [K]; None: the garment has no mirror image

    @property
    def sizes(self):
        """(K, R)."""
        return self.point_joints.shape[:2]


def base(layout, relative):
    """Places [..., K, R, 3] of the points without displacement, relative [..., J, 4, 4] skinning matrices."""
    m = relative[..., layout.point_joints, :3, :]                                  # [..., K, R, 4, 3, 4]
    return np.einsum("...krijc,kric->...krj", m, layout.point_parts)


def displacements(layout, relative, truth, ticks=64):
    """Points [T, K, 3, R] of true cloth [T, n, 3] in their patches' frames, less their base. m."""
    patches, points = layout.sizes
    out = np.empty((len(truth), patches, 3, points), np.float32)
    for at in range(0, len(truth), ticks):
        some = slice(at, at + ticks)
        part = truth[some].astype(np.float64)
        mean = (layout.points_of @ part.transpose(1, 0, 2).reshape(part.shape[1], -1)).reshape(-1, len(part), 3)
        mean = mean.transpose(1, 0, 2).reshape(len(part), patches, points, 3)
        turned = relative[some][:, layout.patch_joint, :3, :3] @ layout.axes
        out[some] = np.einsum("tkji,tkrj->tkir", turned, mean - base(layout, relative[some]))
    return out


def mirrored(layout, moved):
    """Displacements [..., K, 3, R] with left and right swapped."""
    return moved[..., layout.mirror, :, :] * np.array([1, 1, -1], np.float32)[:, None]


def poses(relative, hips, wind, rate=30.0):
    """What a tick reads of a pose [T, 12 J + 6] float32: skinning matrices from the hips, their way, wind a tick.

    relative [T, J, 4, 4]; hips [T, 3] m; wind [T, 3] m/s or None."""
    matrices = relative[:, :, :3].copy()
    matrices[..., 3] -= hips[:, None]
    way = np.diff(hips, axis=0, prepend=hips[:1])
    wind = np.zeros_like(hips) if wind is None else wind / rate
    return np.concatenate([matrices.reshape(len(hips), -1), way, wind], 1).astype(np.float32)
