"""Stage 1: pivots and skinning weights that drape the garment on a still pose."""
import torch
from torch import nn

PRUNED_DEPTH = 0.05


class StaticStage(nn.Module):
    """D = MLP(x), W = normalise(max(W_I + sum_i W_i, 0)), v = sum_j w_ij A_j (T_i + delta_i)."""
    TRAINED = ("mlp.", "residual_weights")

    def __init__(self, template, pivots, initial_weights, features, width=256, residuals=None):
        super().__init__()
        n, m = initial_weights.shape
        self.register_buffer("template", template)                  # [n, 3]
        self.register_buffer("pivots", pivots)                      # [m, 3] J_C
        self.register_buffer("initial_weights", initial_weights)    # [n, m] W_I
        self.mlp = nn.Sequential(nn.Linear(features, width), nn.ReLU(), nn.Linear(width, 3 * m))
        self.residual_weights = nn.Parameter(torch.zeros(m if residuals is None else residuals,
                                                         n, m))
        nn.init.zeros_(self.mlp[2].weight)   # D = 0: training starts at plain skinning
        nn.init.zeros_(self.mlp[2].bias)

    @classmethod
    def fresh(cls, parts, options):
        return cls(parts.template, parts.pivots, parts.initial_weights, parts.features, options.static_width)

    @classmethod
    def of_bundle(cls, tensors, parts):
        stage = cls(parts.template, parts.pivots, parts.initial_weights, parts.features,
                    len(tensors.get("static.mlp.0.bias")), len(tensors.get("static.residual_weights")))
        return tensors.fill(stage.double(), "static.")

    def trained(self):
        """The residual weights' sum alone, [1, n, m]: the skin depends on nothing else of them."""
        found = {name: value for name, value in self.state_dict().items() if name.startswith(self.TRAINED)}
        return {**found, "residual_weights": self.residual_weights.sum(0, keepdim=True)}

    def given(self, fitted):
        return {"static.initial_weights": fitted.initial_weights}

    @torch.no_grad()
    def take(self, other):
        """Become `other`, whose residual weights may be as many as it likes: a bundle holds their sum."""
        residuals = torch.zeros_like(self.residual_weights)
        residuals[0] = other.residual_weights.sum(0)
        self.load_state_dict({**other.state_dict(), "residual_weights": residuals})

    def weights(self):
        """[n, m], rows sum to 1."""
        raw = (self.initial_weights + self.residual_weights.sum(0)).clamp(min=0)
        return raw / raw.sum(1, keepdim=True)

    @torch.no_grad()
    def prune(self, influences):
        """Keep the strongest `influences` bones of each vertex; the others stay at zero for good.

        Their sum is set below zero, where max(., 0) passes no gradient and half floats no error.
        """
        weights = self.weights()
        strongest = weights.topk(min(influences, weights.shape[1]))
        kept = torch.zeros_like(weights, dtype=torch.bool).scatter_(1, strongest.indices, strongest.values > 0)
        below = -(self.initial_weights + PRUNED_DEPTH) / len(self.residual_weights)
        self.residual_weights.copy_(torch.where(kept, self.residual_weights, below))

    @torch.no_grad()
    def lay(self, weights, influences):
        """Skins with `weights` [n, m], the strongest `influences` of each vertex, and D = 0, for all poses."""
        change = weights.to(self.initial_weights) - self.initial_weights
        self.residual_weights.copy_(change / len(self.residual_weights))
        self.prune(influences)
        nn.init.zeros_(self.mlp[2].weight)
        nn.init.zeros_(self.mlp[2].bias)

    def increments(self, x):
        """D [..., m, 3]."""
        return self.mlp(x).reshape(*x.shape[:-1], -1, 3)

    def bone_matrices(self, x, linear, posed):
        """A [..., m, 3, 4] from R [..., m, 3, 3] and p [..., m, 3]."""
        pivots = self.pivots + self.increments(x)
        offset = posed - (linear @ pivots.unsqueeze(-1)).squeeze(-1)
        return torch.cat([linear, offset.unsqueeze(-1)], -1)

    def blend(self, bone_matrices, weights=None, vertices=None):
        """sum_j w_ij A_j: [..., n or len(vertices), 3, 4]."""
        weights = self.weights() if weights is None else weights
        if vertices is not None:
            weights = weights[vertices]
        flat = weights @ bone_matrices.reshape(*bone_matrices.shape[:-3], -1, 12)
        return flat.reshape(*flat.shape[:-1], 3, 4)

    def skin(self, blended, displacement=None):
        """Blended matrices [..., n, 3, 4] and displacement [..., n, 3] -> positions."""
        point = self.template if displacement is None else self.template + displacement
        return (blended[..., :3] @ point.unsqueeze(-1)).squeeze(-1) + blended[..., 3]

    def forward(self, x, linear, posed, displacement=None):
        return self.skin(self.blend(self.bone_matrices(x, linear, posed)), displacement)
