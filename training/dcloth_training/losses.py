"""Vertex distance, the loss of every stage (paper eq. 17), and depth below the body, in metres."""
import torch

SMOOTHING = 1e-4   # metres: sqrt(d^2 + e^2) keeps the gradient finite at zero distance
MARGIN = 0.002     # metres outside the body that the network should keep, where the truth does


def distance(error):
    """Mean Euclidean length of [..., 3]."""
    return ((error * error).sum(-1) + SMOOTHING ** 2).sqrt().mean()


def skinned(linear, weights, error):
    """L_v error_v [..., v, 3]: an error of template space as it shows after skinning.

    linear [..., m, 3, 3] of the bones, weights [v, m] of the vertices: L_v = sum_j w_vj R_j.
    """
    blended = weights @ linear.reshape(*linear.shape[:-2], 9)
    blended = blended.reshape(*error.shape[:-1], 3, 3)
    return (blended @ error.unsqueeze(-1)).squeeze(-1)


def skinned_distance(linear, weights, error):
    """Mean |L_v error_v|, see skinned()."""
    return distance(skinned(linear, weights, error))


def below(planes, error):
    """Mean depth in m of cloth that `error` [..., v, 3] moved to the far side of its plane [..., v, 4] (body_planes).

    What is less than MARGIN outside counts as inside already, where the truth has that much room.
    """
    room = planes[..., 0].clamp(min=0)
    moved = room + (planes[..., 1:] * error).sum(-1)
    return (room.clamp(max=MARGIN) - moved).clamp(min=0).mean()


def outside(error, planes, weight):
    """distance(error), and `weight` times the depth below the body; planes None: the body is not known."""
    return distance(error) if planes is None else distance(error) + weight * below(planes, error)


def pick_vertices(count, size, generator):
    """A random subset of vertex numbers, without repetition."""
    return torch.randperm(count, generator=generator)[:min(size, count)]
