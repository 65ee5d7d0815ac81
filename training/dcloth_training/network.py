"""The whole network: features in, cloth positions out, stopping after any stage."""
import numpy as np
import torch
from torch import nn

from . import features as pose_features

STAGES = ("static", "skeleton", "mesh")


class Pose:
    """What the stages read of a sequence, as tensors; see pose_of()."""

    def __init__(self, x, linear, posed, body_frame, wind=None):
        self.x = x                    # [T, d] raw features
        self.linear = linear          # [T, m, 3, 3] R_j
        self.posed = posed            # [T, m, 3] p_j
        self.body_frame = body_frame  # [T, J, 3, 4] H^-1 G_j B_j^-1
        self.wind = wind              # [T, 3] in the heading frame, m/s; None: not known

    def __len__(self):
        return len(self.x)


def pose_of(matrices, rig, dtype=torch.float64, device="cpu", wind=None):
    """Joint matrices [T, J, 4, 4] and wind [T, 3] -> Pose, one sequence from a reset; computed in float64."""
    relative = pose_features.relative(matrices, rig.bind)
    rotation, origin, _ = pose_features.heading_frames(matrices, rig.bind, rig.hips)
    x = pose_features.raw(matrices, rig.bind, rig.hips, rig.feature_joints, rig.rate,
                          rig.root_motion, wind)
    wind = pose_features.in_heading(rotation, pose_features.calm(len(x)) if wind is None else wind)
    pivots = np.asarray(rig.bind, np.float64)[rig.bones, :3, 3]
    of_bones = relative[:, rig.bones]
    linear, shift = of_bones[..., :3, :3], of_bones[..., :3, 3]
    posed = np.einsum("tjab,jb->tja", linear, pivots) + shift
    shifted = relative[:, :, :3].copy()
    shifted[..., 3] -= origin[:, None]
    frame = np.einsum("tji,tkjl->tkil", rotation, shifted)
    return Pose(*(torch.as_tensor(v).to(dtype=dtype, device=device)
                  for v in (x, linear, posed, frame, wind)))


class BodyPoints(nn.Module):
    """The nearest body points of the garment, posed, in the heading frame: one matrix product."""

    def __init__(self, points, joint_weights):
        super().__init__()
        points, joint_weights = torch.as_tensor(points), torch.as_tensor(joint_weights)
        homogeneous = torch.cat([points, torch.ones_like(points[:, :1])], 1)
        self.register_buffer("mixing", (joint_weights[:, :, None] * homogeneous[:, None])
                             .reshape(len(points), -1), persistent=False)   # [n, 4 J]

    def forward(self, body_frame):
        """[B, J, 3, 4] -> [n, B, 3]."""
        columns = body_frame.permute(1, 3, 0, 2).reshape(self.mixing.shape[1], -1)
        return (self.mixing @ columns).reshape(len(self.mixing), -1, 3)


class DCloth(nn.Module):
    """All stages of one garment; `skeleton` and `mesh` may be None."""

    def __init__(self, standardise, static, skeleton=None, body_points=None, mesh=None):
        super().__init__()
        self.standardise, self.static = standardise, static
        self.skeleton, self.body_points, self.mesh = skeleton, body_points, mesh

    def last_stage(self):
        return "static" if self.skeleton is None else "mesh" if self.mesh else "skeleton"

    @torch.no_grad()
    def run(self, pose, stages=None, intermediates=None):
        """Positions [T, n, 3] of one sequence from a reset, tick by tick.

        `intermediates`: a dict that receives features, pivots, h_S and Q, one row a tick.
        """
        stages = stages or self.last_stage()
        depth = STAGES.index(stages)
        if depth > STAGES.index(self.last_stage()):
            raise ValueError(f"stage '{stages}' asked for, the model stops after "
                             f"'{self.last_stage()}'")
        x = self.standardise(pose.x)
        weights = self.static.weights()
        notes = {"features": x, "pivots": self.static.pivots + self.static.increments(x)}
        h_s, q = None, []
        if depth >= 1:
            h_s = self.skeleton(x[None])[0][0]
            notes["h_S"] = h_s
        states = self.mesh.reset(1, x) if depth == 2 else None
        out = []
        for t in range(len(pose)):
            bones = self.static.bone_matrices(x[t], pose.linear[t], pose.posed[t])
            delta = self.skeleton.displacement(h_s[t]) if depth >= 1 else None
            if depth == 2:
                s, states = self.mesh.embedded(self.body_points(pose.body_frame[t:t + 1]), states)
                q.append(self.mesh.coefficients(s)[0])
                delta = delta + self.mesh.displacement(q[-1])
            out.append(self.static.skin(self.static.blend(bones, weights), delta))
        if q:
            notes["Q"] = torch.stack(q)
        if intermediates is not None:
            intermediates.update(notes)
        return torch.stack(out)
