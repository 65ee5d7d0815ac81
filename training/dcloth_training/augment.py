"""What training does to features besides mirroring: other people, other velocities, poses that no clip has."""
import torch

JITTER = 0.2                  # of the noise's deviation
FARTHEST = 2.0                # times as far from the mean pose
CARRIED = (1.0, 0.15, 1.0)    # deviation of the velocity a window is carried at, by axis, times --carried


def noisy(x, deviation):
    """Features x [B, T, d] of slightly other people: an offset a window, a fifth of it a tick.

    More a tick would drown what the network must see: 0.05 of a root velocity's deviation (2 m/s) from
    tick to tick is an acceleration of 4 m/s^2.
    """
    offset, jitter = torch.randn_like(x[:, :1]), torch.randn_like(x)
    return x + deviation * (offset + JITTER * jitter)


def farther(x, which, standardise, generator):
    """Standardised features x [B, T, d] with joints of the windows `which` [B] bool 1 to FARTHEST times as far from the
    mean pose, but within the features' range, beyond which they are clamped."""
    joints = x.shape[-1] // 9 * 9
    factors = 1 + (FARTHEST - 1) * which * torch.rand(len(x), generator=generator)
    far = factors.to(x.device)[:, None, None] * x[..., :joints]
    far = torch.maximum(torch.minimum(far, standardise.high[:joints]), standardise.low[:joints])
    return torch.cat([far.to(x.dtype), x[..., joints:]], -1)


def velocities(windows, deviation, generator):
    """[B, 3] m/s: what each window is carried at; clips start at rest, so their first windows are not."""
    inside = torch.tensor([[float(not w.fresh)] for w in windows])
    return deviation * inside * torch.tensor(CARRIED) * torch.randn(len(windows), 3, generator=generator)
