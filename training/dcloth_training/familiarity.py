"""How far a motion is from all that a network learned from: the nearest third of a second, feature by feature."""
import numpy as np
import torch

from . import dataset, reference, sequence

STEPS, STRIDE = 3, 5      # a window: this frame, 5 and 10 frames before it
KEPT_EVERY = 2            # training frames: neighbours are alike


def windows(net, pose):
    """Standardised features of each frame and of those before it [T, STEPS d]; before the start lies the start."""
    x = net.standardise(pose.x).numpy().astype(np.float32)
    at = np.arange(len(x))
    return np.concatenate([x[np.maximum(at - STRIDE * step, 0)] for step in range(STEPS)], 1)


class Training:
    """The motion of folders of ground truth without held-out and validation clips; the cloth is not read.

    provenance: the network's, which names those clips.
    """

    def __init__(self, net, rig, folders, provenance):
        apart = (*dataset.held_out(provenance), *provenance.get("validation_clips", dataset.VALIDATION))
        self.net, self.clips, found = net, [], []
        for folder in folders:
            for path in dataset.find(folder, "dynamic", apart):
                item = sequence.read(path, truth=False)
                pose = reference.pose_for(item, rig, torch.float32, path)
                found.append(windows(net, pose)[::KEPT_EVERY])
                self.clips += [item.clip or path] * len(found[-1])
        if not found:
            raise ValueError(f"{', '.join(folders)}: no clips but held-out and validation ones; --training wants "
                             f"ground truth that the network learned from")
        self.windows = np.concatenate(found)
        self._squares = (self.windows * self.windows).sum(1)

    def distance(self, pose):
        """([T] root mean square over features, in their training deviations, to the nearest window; [T] its clip)."""
        asked = windows(self.net, pose)
        squares = self._squares + (asked * asked).sum(1)[:, None] - 2 * asked @ self.windows.T
        nearest = squares.argmin(1)
        away = np.linalg.norm(asked - self.windows[nearest], axis=1) / np.sqrt(asked.shape[1])
        return away, [self.clips[i] for i in nearest]
