"""Is a simulated clip cloth? Exact crossings, depth under the body, stretch and speed, with limits.

A Referee looks at frames; `measure` is a clip's numbers and `refuse` says why a clip must not be used.
"""
import dataclasses

import numpy as np

from .. import metrics
from ..motion import skeleton
from . import body as body_parts, cloth_job, crossings, penetration

# Beyond these a clip is refused. Set from clips that were looked at, see README.md.
MAX_STRETCH_P99 = 1.6          # edge length over rest length, 99th percentile of a frame
MAX_SPEED = 40.0               # m/s, any vertex
MAX_TORN_SHARE = 0.0           # of the frames
MAX_THROUGH_SHARE = 0.10       # of the frames: cloth pinched in the groin or behind a knee for some frames of a run
TORN = 4.0                     # an edge stretched so far hangs on both sides of a limb that went through the cloth
THROUGH = 0.010                # m: cloth so deep under the body is seen to cross it,
THROUGH_PAIRS = 60             # and so is a limb in a loop of these pairs: a wrist, 17 cm about, in a mesh of 1 cm
TANGLED = 10                   # crossing pairs of cloth triangles in a frame from which on cloth counts as tangled


class Referee:
    """Looks at frames of one garment on one body.

    mesh: metrics.Mesh; body: penetration.Body; bind: (vertices [b, 3] m, weights [b, J], bind matrices [J, 4, 4]) of
    the body in bind pose; areas [n] m2 of the cloth's vertices.
    """

    def __init__(self, mesh, body, bind, areas):
        self.mesh, self.body, self.bind, self.areas = mesh, body, bind, areas

    @classmethod
    def of_character(cls, tensors):
        """From a character file's tensors (simulate.run): cloth, body, what may touch what."""
        faces, rest = tensors["cloth_faces"], tensors.get("cloth_rest", tensors["cloth_template"])
        masks = tensors.get("body_parts")
        if masks is None:
            masks = np.asarray(tensors["body_collider"], np.uint32)
        body = penetration.Body(tensors["body_faces"], faces, len(rest), masks=masks,
                                touches=tensors.get("cloth_touches"))
        bind = [np.asarray(tensors[name], np.float64) for name in ("body_vertices", "body_weights", "joint_bind")]
        return cls(metrics.Mesh(faces, rest, tensors.get("cloth_rest_length")), body, bind,
                   penetration.vertex_areas(rest, faces))

    def posed(self, matrices):
        """The body [T, b, 3] m in the poses [T, J, 4, 4]."""
        return skeleton.skin(*self.bind, np.asarray(matrices, np.float64))

    def frame(self, cloth, body):
        """(depth [n] m, cloth pairs [k, 2], body pairs [k, 2]) of cloth [n, 3] and the posed body [b, 3]."""
        depth, pairs = self.body.contact(cloth, body)
        return depth, crossings.within(cloth, self.mesh.faces), pairs

    def clip(self, cloth, matrices, frames):
        """Numbers of `frames` of cloth [T, n, 3] m in the poses [T, J, 4, 4]; 30 ms a frame, 100 where cloth crosses.

        Shares are of frames: crossed (any cloth triangle crosses the body), through (10 mm deep somewhere, or 60
        pairs), tangled (10 pairs of cloth triangles and more), torn. Crossings are pairs a frame.
        """
        frames = np.asarray(frames)
        strains, depths, own, against = [], [], [], []
        for frame, body in zip(frames, self.posed(np.asarray(matrices)[frames])):
            points = np.asarray(cloth[frame], np.float64)
            depth, within, between = self.frame(points, body)
            strains.append(self.mesh.strain(points[None])[0].astype(np.float32))
            depths.append(depth.astype(np.float32))
            own.append(len(within))
            against.append(len(between))
        strains, depths, own, against = (np.array(values) for values in (strains, depths, own, against))
        p99, largest, deepest = np.percentile(strains, 99, axis=1), strains.max(1), depths.max(1)
        under = penetration.summary(depths, self.areas)
        return {
            "frames_measured": len(frames), "strain_p99": round(float(np.percentile(strains, 99)), 4),
            "stretch_p99": round(1 + float(p99.max()), 3), "stretch_max": round(1 + float(largest.max()), 3),
            "stretch_max_frame": int(frames[largest.argmax()]),
            "torn_share": round(float((1 + largest > TORN).mean()), 4),
            "crossed_share": round(float((against > 0).mean()), 4), "body_crossings": round(float(against.mean()), 2),
            "body_crossings_max": int(against.max()), "body_crossings_frame": int(frames[against.argmax()]),
            "tangled_share": round(float((own >= TANGLED).mean()), 4), "cloth_crossings": round(float(own.mean()), 2),
            "cloth_crossings_max": int(own.max()), "cloth_crossings_frame": int(frames[own.argmax()]),
            "penetration_area_share": round(under["area_share"], 6), "penetration_p99_mm": round(under["p99_mm"], 2),
            "penetration_max_mm": round(under["max_mm"], 2),
            "through_share": round(float(((deepest > THROUGH) | (against >= THROUGH_PAIRS)).mean()), 4)}


def speeds(cloth):
    """speed_max, speed_mean in m/s and the first frame's settled_mm_per_frame of cloth [T, n, 3] at skeleton.FPS."""
    speed = np.linalg.norm(np.diff(cloth, axis=0), axis=-1) * skeleton.FPS
    return {"speed_max": round(float(speed.max(initial=0)), 2),
            "speed_mean": round(float(speed.mean()) if speed.size else 0.0, 3),
            "settled_mm_per_frame": round(float(speed[0].mean() * 1e3 / skeleton.FPS) if len(speed) else 0.0, 3)}


def referee(body, garment):
    """The Referee of a simulation's own collider."""
    vertices, faces, weights, masks = cloth_job.collider(body, garment)
    count = len(garment.vertices)
    touched = penetration.Body(faces, garment.faces, count, masks=masks, touches=garment.touches)
    return Referee(metrics.Mesh(garment.faces, garment.vertices, cloth_job.rest_lengths(garment)), touched,
                   (vertices, weights, body_parts.bind_matrices(body)),
                   penetration.vertex_areas(garment.vertices, garment.faces))


def measure(result, body, garment, every=3):
    """Numbers of a simulated clip from every so many frames and the last; all finite or the clip is broken."""
    frames = np.unique(np.r_[np.arange(0, len(result.cloth), every), len(result.cloth) - 1])
    return {**referee(body, garment).clip(result.cloth, result.matrices, frames), **speeds(result.cloth)}


def refuse(numbers):
    """Why a clip must not be used, or None."""
    limits = (("torn_share", MAX_TORN_SHARE), ("stretch_p99", MAX_STRETCH_P99), ("speed_max", MAX_SPEED),
              ("through_share", MAX_THROUGH_SHARE))
    for name, limit in limits:
        if not numbers[name] <= limit:  # also catches NaN
            return f"{name} is {numbers[name]}, limit {limit:g}"
    return None


def drapes(result, body, garment):
    """(result, [P] bool): a file of drapes with the good ones alone. Each is a pose of its own, settled by itself:
    what one knee does to its cloth says nothing about the others. Speed means nothing between them."""
    watching = referee(body, garment)
    good = np.array([refuse({**watching.clip(result.cloth, result.matrices, [pose]), "speed_max": 0.0}) is None
                     for pose in range(len(result.cloth))], bool)
    return dataclasses.replace(result, cloth=result.cloth[good], matrices=result.matrices[good]), good
