"""The whole network: features in, cloth positions out, stopping after any stage."""
import numpy as np
import torch
from torch import nn

from . import features as pose_features, stages

STAGES = stages.NAMES


class Pose:
    """What the stages read of a sequence, as tensors; see pose_of()."""

    def __init__(self, x, linear, posed, body_frame, wind=None, skin=None, way=None, air=None):
        self.x = x                    # [T, d] raw features
        self.linear = linear          # [T, m, 3, 3] R_j
        self.posed = posed            # [T, m, 3] p_j
        self.body_frame = body_frame  # [T, J, 3, 4] H^-1 G_j B_j^-1
        self.wind = wind              # [T, 3] in the heading frame, m/s; None: not known
        self.skin = skin              # [T, J, 3, 4] G_j B_j^-1, from the hips
        self.way = way                # [T, 3] of the hips since the tick before, m
        self.air = air                # [T, 3] wind in the world, m a tick

    def __len__(self):
        return len(self.x)

    def at(self, ticks):
        """The Pose of some ticks, a slice."""
        return Pose(*(None if v is None else v[ticks] for v in (
            self.x, self.linear, self.posed, self.body_frame, self.wind, self.skin, self.way, self.air)))


def pose_of(matrices, rig, dtype=torch.float64, device="cpu", wind=None):
    """Joint matrices [T, J, 4, 4] and wind [T, 3] -> Pose, one sequence from a reset; computed in float64."""
    relative = pose_features.relative(matrices, rig.bind)
    rotation, origin, _ = pose_features.heading_frames(matrices, rig.bind, rig.hips)
    x = pose_features.raw(matrices, rig.bind, rig.hips, rig.feature_joints, rig.rate,
                          rig.root_motion, wind)
    air = pose_features.calm(len(x)) if wind is None else np.asarray(wind, np.float64)
    wind = pose_features.in_heading(rotation, air)
    pivots = np.asarray(rig.bind, np.float64)[rig.bones, :3, 3]
    of_bones = relative[:, rig.bones]
    linear, shift = of_bones[..., :3, :3], of_bones[..., :3, 3]
    posed = np.einsum("tjab,jb->tja", linear, pivots) + shift
    shifted = relative[:, :, :3].copy()
    shifted[..., 3] -= origin[:, None]
    frame = np.einsum("tji,tkjl->tkil", rotation, shifted)
    way = np.diff(origin, axis=0, prepend=origin[:1])
    return Pose(*(torch.as_tensor(v).to(dtype=dtype, device=device)
                  for v in (x, linear, posed, frame, wind, shifted, way, air / rig.rate)))


class DCloth(nn.Module):
    """All stages of one garment, each an attribute of its name, None where it has none."""

    def __init__(self, standardise, static, skeleton=None, mesh=None, patch=None):
        super().__init__()
        self.standardise = standardise
        for name, module in {"static": static, "skeleton": skeleton, "mesh": mesh, "patch": patch}.items():
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
