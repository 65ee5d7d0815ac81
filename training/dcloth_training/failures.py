"""Where a model fails: the worst frames of clips it never saw, as pictures and figures.

    python3 -m dcloth_training.failures BUNDLE SEQUENCE... -o FOLDER [--count 5] [--training DATA]...

Writes FOLDER/<clip>-<frame>.png, the truth beside what the network makes of the same pose, its error in colour, and
FOLDER/failures.json. A clip's worst frame is the one with the largest mean vertex distance among those that count
(metrics.WARM_UP); each clip appears once.
With the ground truth that the network learned from it says how far that moment's motion is from the nearest there.
"""
import argparse
import json
import os
import sys

import numpy as np
import torch

from . import bundle, failure_pictures, familiarity, metrics, network, reference, sequence

LAGS = 6        # frames by which a prediction may be early or late


def in_hips(positions, matrices, hips):
    """Positions [T, n, 3] in the hips' frame."""
    joint = np.asarray(matrices, np.float64)[:, hips]
    return np.einsum("tji,tnj->tni", joint[:, :3, :3], positions - joint[:, None, :3, 3])


def lag(predicted, truth, frame):
    """By how many frames the truth that frame's prediction looks like most is older: 2 means two frames late.

    Both [T, n, 3] in the hips' frame.
    """
    near = np.arange(max(0, frame - LAGS), min(len(truth), frame + LAGS + 1))
    distance = np.linalg.norm(truth[near] - predicted[frame], axis=-1).mean(1)
    return int(frame - near[distance.argmin()]), float(1e3 * distance.min())


def beyond(net, pose, frame):
    """How many pose features of a frame lie outside the training range, where they are clamped."""
    standard = (pose.x[frame] - net.standardise.mean) / net.standardise.deviation
    return int(((standard > net.standardise.high) | (standard < net.standardise.low)).sum())


class Case:
    """The worst frame of one clip: figures, and the two shapes of the cloth."""

    def __init__(self, net, rig, item, path, stages=None, training=None):
        if item.truth is None:
            raise ValueError(f"{path}: no truth to compare with")
        matrices = reference.matrices_for(item, rig, path)
        pose = reference.pose_for(item, rig, net.static.template.dtype, path)
        predicted = net.run(pose, stages).double().numpy()
        if predicted.shape != item.truth.shape:
            raise ValueError(f"{path}: truth {list(item.truth.shape)}, the network makes {list(predicted.shape)}")
        distance = metrics.distances_mm(predicted, item.truth)
        first = metrics.counted(len(distance))
        frame = first + int(distance[first:].mean(1).argmax())
        late, nearest = lag(in_hips(predicted, matrices, rig.hips), in_hips(item.truth, matrices, rig.hips), frame)
        self.matrices, self.truth, self.predicted = matrices[frame], item.truth[frame], predicted[frame]
        self.distance_mm = distance[frame]
        self.figures = {
            "clip": item.clip or os.path.splitext(os.path.basename(path))[0], "frame": frame,
            "second": round(frame / item.fps, 2), "mean_mm": round(float(distance[frame].mean()), 1),
            "p99_mm": round(float(np.percentile(distance[frame], 99)), 1),
            "max_mm": round(float(distance[frame].max()), 1),
            "clip_mean_mm": round(float(distance[first:].mean()), 1),
            "clip_alive_mm": round(metrics.alive_mm(item.truth[first:], matrices[first:, rig.hips]), 1),
            "shift_mm": round(float(1e3 * np.linalg.norm((predicted[frame] - item.truth[frame]).mean(0))), 1),
            "frames_late": late, "mean_mm_against_that_frame": round(nearest, 1),
            "features_beyond_training": beyond(net, pose, frame)}
        if training:
            away, alike = training.distance(pose)
            self.figures.update(motion_away=round(float(away[frame]), 2), clip_motion_away=round(float(away.mean()), 2),
                                most_alike=alike[frame])


def worst(net, rig, paths, count, stages=None, training=None, log=print):
    """The `count` worst cases, the worst first; one a clip. training: familiarity.Training."""
    cases = {}
    for path in paths:
        case = Case(net, rig, sequence.read(path), path, stages, training)
        found = case.figures
        log(f"{found['clip']}: {found['clip_mean_mm']} mm, worst at {found['second']} s (frame {found['frame']}): "
            f"{found['mean_mm']} mm, p99 {found['p99_mm']}, max {found['max_mm']}; {found['frames_late']:+d} frames "
            f"late, {found['mean_mm_against_that_frame']} mm from that frame's truth; "
            f"{found['features_beyond_training']} features beyond training"
            + (f", motion {found['motion_away']} away (clip {found['clip_motion_away']}), nearest "
               f"{found['most_alike']}" if training else ""))
        if found["clip"] not in cases or cases[found["clip"]].figures["mean_mm"] < found["mean_mm"]:
            cases[found["clip"]] = case
    return sorted(cases.values(), key=lambda case: -case.figures["mean_mm"])[:count]


def write(cases, body, faces, folder):
    """Pictures and failures.json; pictures of an older one's other frames go, each "why" written there stays."""
    os.makedirs(folder, exist_ok=True)
    listing = os.path.join(folder, "failures.json")
    try:
        with open(listing) as file:
            old = {row["picture"]: row.get("why") for row in json.load(file)}
    except (OSError, ValueError, KeyError, TypeError):
        old = {}
    limit = failure_pictures.limit_mm([case.distance_mm for case in cases])
    rows = []
    for case in cases:
        name = f"{case.figures['clip'].replace('/', '-')}-{case.figures['frame']}.png"
        failure_pictures.draw(os.path.join(folder, name), case, body, faces, limit)
        rows.append({**case.figures, "picture": name, **({"why": old[name]} if old.get(name) else {})})
    with open(listing + ".part", "w") as file:
        json.dump(rows, file, indent=1)
        file.write("\n")
    os.replace(listing + ".part", listing)
    for name in set(old) - {row["picture"] for row in rows}:
        if os.path.basename(name) == name and os.path.exists(os.path.join(folder, name)):
            os.unlink(os.path.join(folder, name))
    return rows


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bundle")
    parser.add_argument("sequences", nargs="+", help="clips with truth that training never saw")
    parser.add_argument("-o", "--out", required=True, help="folder of the pictures")
    parser.add_argument("--count", type=int, default=5, help="pictures, at most")
    parser.add_argument("--training", action="append", help="ground truth that the network learned from; repeatable")
    parser.add_argument("--stages", choices=network.STAGES)
    options = parser.parse_args(argv)
    if options.count < 1:
        parser.error(f"--count {options.count}: at least 1")
    try:
        net, rig, faces, metadata = bundle.read(options.bundle, torch.float32)
        training = None
        if options.training:
            provenance = json.loads(metadata.get("training", "{}"))
            training = familiarity.Training(net, rig, options.training, provenance)
        cases = worst(net, rig, options.sequences, options.count, options.stages, training)
        write(cases, failure_pictures.read_body(options.bundle), faces, options.out)
    except (OSError, ValueError) as error:
        print(f"failures: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
