"""The patch stage: a graph GRU on strips of the garment that see their own last cloth and the limbs beside them.

Formulas: engine/format/NETWORK.md, Patch stage. This module plays it and holds what a bundle stores;
training/patch_bptt computes the same with its gradient.
"""
import numpy as np
import torch
from torch import nn

LIMIT, LENGTH = 8.0, 10.0
REACH, DEEPEST, FARTHEST, SPEED, FASTEST = 0.08, -0.1, 0.3, 10.0, 4.0
JOINT, WIND, ACCELERATION = 2.0, 6.0, 20.0
MOVE = 0.1      # m an output
NEAREST = 1e-4  # m
GEOMETRY = ("axes", "centres", "point_parts", "capsules")
INDICES = ("joints", "point_joints", "capsule_joints", "limbs", "near")


def inputs_of(points, embedding):
    """I."""
    return 19 * points + 33 + embedding


class PatchStage(nn.Module):
    """Buffers hold the layout; K patches of R points, M sources of a point's vertices."""
    NOTE = "u"

    def __init__(self, arrays, width, embedding, vertices, sources):
        """arrays: name -> array, as a bundle's patch.<name>."""
        super().__init__()
        for name in GEOMETRY:
            self.register_buffer(name, torch.as_tensor(np.asarray(arrays[name], np.float64)).float())
        for name in INDICES:
            self.register_buffer(name, torch.as_tensor(np.asarray(arrays[name], np.int64)))
        patches, points = self.point_joints.shape[:2]
        layers, neighbours = self.near.shape[:2]
        inputs, out = inputs_of(points, embedding), 3 * points

        def zeros(*shape):
            return nn.Parameter(torch.zeros(*shape))

        self.embedding = zeros(patches, embedding)
        self.enter = nn.Linear(inputs, width)
        self.mix = nn.ModuleList(nn.Linear((1 + neighbours) * width, width) for _ in range(layers))
        self.gates = nn.ParameterDict({"weight_ih": zeros(3 * width, width), "weight_hh": zeros(3 * width, width),
                                       "bias": zeros(3 * width)})
        self.out = nn.Linear(width + inputs, out)
        self.keep = zeros(points)
        self.map = nn.ParameterDict({"weights": zeros(vertices, sources, 3, 3), "offsets": zeros(vertices, 3)})
        self.register_buffer("sources", torch.zeros(patches * points, sources, dtype=torch.long))
        self.register_buffer("groups", torch.zeros(vertices, dtype=torch.long))

    @classmethod
    def fresh(cls, parts, options):
        """None: the patches are cut when stage 1 is trained."""

    @classmethod
    def shaped_as(cls, state):
        """An untrained stage of a state_dict's shapes."""
        vertices, sources = state["map.weights"].shape[:2]
        return cls({name: state[name] for name in GEOMETRY + INDICES}, len(state["enter.bias"]),
                   state["embedding"].shape[1], vertices, sources)

    @classmethod
    def of_bundle(cls, tensors, parts):
        if tensors.find("patch.joints") is None:
            return None
        arrays = {name: tensors.get("patch." + name).numpy() for name in GEOMETRY + INDICES}
        sources = tensors.get("patch.map.sources").long()
        stage = cls(arrays, len(tensors.get("patch.enter.bias")), tensors.get("patch.embedding").shape[1],
                    len(parts.template), sources.shape[1]).double()
        for name in GEOMETRY:       # of_bundle's numbers in full
            setattr(stage, name, tensors.get("patch." + name))
        stage.sources, stage.groups = sources, tensors.get("patch.map.groups").long()
        return tensors.fill(stage, "patch.")

    def trained(self):
        return {name: value for name, value in self.named_parameters() if name != "map.offsets"}

    def given(self, fitted):
        """Geometry, and the offsets: both are metres and stay float32."""
        out = {f"patch.{name}": getattr(self, name) for name in GEOMETRY}
        return {**out, "patch.map.offsets": self.map["offsets"]}

    def indices(self):
        """{whole name: array} of what a bundle stores as integers."""
        out = {f"patch.{name}": getattr(self, name) for name in INDICES}
        return {**out, "patch.map.sources": self.sources, "patch.map.groups": self.groups}

    @property
    def sizes(self):
        """(K, R)."""
        return self.point_joints.shape[:2]

    def frames(self, matrices):
        """(axes [K, 3, 3], centres [K, 3], bases [K, R, 3]) of a tick's skinning matrices [J, 3, 4]."""
        own = matrices[self.joints]
        axes = own[:, :, :3] @ self.axes
        centres = (own[:, :, :3] @ self.centres[..., None])[..., 0] + own[:, :, 3]
        parts = matrices[self.point_joints]                                        # [K, R, 4, 3, 4]
        return axes, centres, (parts @ self.point_parts[..., None])[..., 0].sum(2)

    def ends(self, matrices):
        """[C, 2, 3] of the capsules."""
        own = matrices[self.capsule_joints]
        at = self.capsules[:, :6].reshape(-1, 2, 3)
        return torch.einsum("cij,cej->cei", own[:, :, :3], at) + own[:, None, :, 3]

    def beside(self, axes, places, ends, before):
        """Input 4 [K, 2, 5, R]. No gradient: whatever pushed cloth into a leg would be learned from."""
        start, way = ends[:, 0], ends[:, 1] - ends[:, 0]
        found = []
        for end in range(2):
            c = self.limbs[:, :, end]                                              # [K, 2]
            a, d = start[c][:, :, None], way[c][:, :, None]                        # [K, 2, 1, 3]
            rel = places[:, None] - a                                              # [K, 2, R, 3]
            s = ((rel * d).sum(-1) / (d * d).sum(-1).clamp(min=1e-8)).clamp(0, 1)[..., None]
            away = rel - s * d
            length = away.square().sum(-1).sqrt().clamp(min=NEAREST)
            radius = self.capsules[c][:, :, None, 6:]
            distance = length - (radius[..., 0] + s[..., 0] * (radius[..., 1] - radius[..., 0]))
            normal = away / length[..., None]
            moved = (ends - before)[c][:, :, None]                                 # [K, 2, 1, 2, 3]
            speed = (normal * (moved[..., 0, :] + s * (moved[..., 1, :] - moved[..., 0, :]))).sum(-1)
            found.append((distance, normal, speed))
        first = found[1][0] >= found[0][0]
        distance, speed = (torch.where(first, found[0][i], found[1][i]) for i in (0, 2))
        normal = torch.where(first[..., None], found[0][1], found[1][1])
        near = torch.exp(-distance.clamp(min=0) / REACH)
        inside = torch.einsum("kji,klrj->klir", axes, normal) * near[:, :, None]
        return torch.cat([inside, LENGTH * distance.clamp(DEEPEST, FARTHEST)[:, :, None],
                          (SPEED * near * speed).clamp(-FASTEST, FASTEST)[:, :, None]], 2)

    def fresh_state(self, matrices):
        """State on the first pose: everything rests."""
        axes, centres, bases = self.frames(matrices)
        patches, points = self.sizes
        u = bases.new_zeros(patches, 3, points)
        return {"u": u, "x": (bases, bases), "ends": self.ends(matrices), "centres": (centres, centres),
                "h": bases.new_zeros(patches, self.gates["bias"].shape[0] // 3)}

    def tick(self, matrices, way, wind, state):
        """One tick: skinning matrices [J, 3, 4] from the hips, the hips' way [3] since the last one, wind [3] m a
        tick -> displacements [K, 3, R]. `state` advances."""
        axes, centres, bases = self.frames(matrices)
        inside = axes.transpose(1, 2)
        x1, x2 = (x - way for x in state["x"])
        c1, c2 = (c - way for c in state["centres"])
        before, ends = state["ends"] - way, self.ends(matrices)

        def local(v):                   # [K, R, 3] -> [K, 3, R]
            return inside @ v.transpose(1, 2)

        def of(v):                      # [K, v, 3] -> [K, 3 v], in patches' frames
            return torch.einsum("kij,kvj->kvi", inside, v).flatten(1)

        def bound(v):
            return v.clamp(-LIMIT, LIMIT)

        u = state["u"]
        seen = self.limbs.flatten(1)                                               # [K, 4]
        tips, moved = ends[:, 1][seen], (ends - before)[:, 1][seen]
        joints = torch.stack([JOINT * (tips - centres[:, None]), LENGTH * moved], 2).flatten(1, 2)
        world = torch.stack([way.new_tensor([0, -1.0, 0]).expand_as(centres), WIND * wind.expand_as(centres),
                             ACCELERATION * (centres - 2 * c1 + c2)], 1)
        x = torch.cat([bound(LENGTH * u).flatten(1), bound(LENGTH * (local(x1 - bases) - u)).flatten(1),
                       bound(LENGTH * local(x1 - x2)).flatten(1),
                       self.beside(axes, x1.detach(), ends, before).flatten(1), bound(of(joints)), bound(of(world)),
                       self.embedding], 1)
        f = torch.relu(self.enter(x))
        for layer, near in zip(self.mix, self.near):
            f = f + torch.relu(layer(torch.cat([f, *f[near]], 1)))
        width = f.shape[1]
        a = f @ self.gates["weight_ih"].T + self.gates["bias"]
        c = state["h"] @ self.gates["weight_hh"].T
        r, z = torch.sigmoid(a[:, :2 * width] + c[:, :2 * width]).split(width, 1)
        q = torch.tanh(a[:, 2 * width:] + r * c[:, 2 * width:])
        h = q + z * (state["h"] - q)
        u = MOVE * self.out(torch.cat([h, x], 1)).reshape(u.shape) + self.keep * u
        state.update(u=u, x=(bases + (axes @ u).transpose(1, 2), x1), ends=ends, centres=(centres, c1), h=h)
        return u

    def play(self, x, pose):
        """Displacements [K * 3 * R] of each tick from a reset."""
        state = None
        for matrices, way, wind in zip(pose.skin, pose.way, pose.air):
            state = state or self.fresh_state(matrices)
            yield self.tick(matrices, way, wind, state).flatten()

    def displacement(self, coefficients):
        """[K * 3 * R] -> [n, 3]."""
        patches, points = self.sizes
        u = coefficients.reshape(patches, 3, points).transpose(1, 2).reshape(-1, 3)
        return torch.einsum("vmab,vmb->va", self.map["weights"], u[self.sources[self.groups]]) + self.map["offsets"]
