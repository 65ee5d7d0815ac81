"""The whole network: features in, cloth positions out, stopping after any stage."""
import numpy as np
import torch
from torch import nn

from . import features as pose_features, stages

STAGES = stages.NAMES


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


class DCloth(nn.Module):
    """All stages of one garment, each an attribute of its name; those after the first may be None, from the last one
    back."""

    def __init__(self, standardise, static, skeleton=None, mesh=None, **later):
        super().__init__()
        self.standardise = standardise
        for name, module in {"static": static, "skeleton": skeleton, "mesh": mesh, **later}.items():
            setattr(self, name, module)

    def last_stage(self):
        return [name for name in stages.NAMES if getattr(self, name) is not None][-1]

    @torch.no_grad()
    def run(self, pose, last=None, intermediates=None):
        """Positions [T, n, 3] of one sequence from a reset, tick by tick, with the stages up to `last`.

        `intermediates`: a dict that receives features, pivots and each stage's coefficients (h_S, Q), one row a tick.
        """
        chosen = stages.up_to(last or self.last_stage())
        if getattr(self, chosen[-1].name) is None:
            raise ValueError(f"stage '{last}' asked for, the model stops after '{self.last_stage()}'")
        x = self.standardise(pose.x)
        weights = self.static.weights()
        later = [getattr(self, stage.name) for stage in chosen[1:]]
        rows, out, played = [[] for _ in later], [], [stage.play(x, pose) for stage in later]
        for t in range(len(pose)):
            bones = self.static.bone_matrices(x[t], pose.linear[t], pose.posed[t])
            delta = None
            for stage, coefficients, row in zip(later, played, rows):
                row.append(next(coefficients))
                moved = stage.displacement(row[-1])
                delta = moved if delta is None else delta + moved
            out.append(self.static.skin(self.static.blend(bones, weights), delta))
        if intermediates is not None:
            intermediates.update({"features": x, "pivots": self.static.pivots + self.static.increments(x)})
            intermediates.update({stage.NOTE: torch.stack(row) for stage, row in zip(later, rows)})
        return torch.stack(out)
