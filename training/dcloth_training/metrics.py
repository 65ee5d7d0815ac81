"""What a predicted garment is worth: every measure with its one definition.

Lengths in millimetres, over all vertices and over the frames of a clip after its first WARM_UP. "The hips' frame" is
the rigid frame of the hips' joint, turn and tilt included. A clip's measures are a dict (`clip`). Those of several
clips (`over_clips`) are means in which every clip weighs the same; quotients are of sums.

    position_mm      E_d: distance of vertices to the truth (eq. 19 of the paper); normal_deg: E_n
    alive_mm         mean distance of the truth from its own mean shape over the clip, hips' frame: its motion
    relative_error   E_d / motion
    offset_mm        distance between the two mean shapes over the clip, hips' frame
    motion_error_mm  mean distance when each has lost its own mean shape, hips' frame; relative_motion_error: / motion
    bands            x is split by averaging over mesh neighbours (x <- (x + mean of neighbours) / 2): coarse is what 40
                     steps leave (waves longer than about 6 edges), middle what 8 steps leave beyond it, fine the rest.
                     error_mm: mean distance to the truth within the band; energy_ratio: rms of the band's motion about
                     its mean over the clip (hips' frame), prediction's over truth's: below 1 wrinkles are averaged away
    fine_motion_mm   mean length of the truth's middle and fine bands together about their mean, hips' frame
    penetration      area_share: share of the area more than 1 mm under the body; p99_mm: 99th percentile of depth
    crossings        intersecting pairs of triangles a frame: cloth with cloth, cloth with body
    strain_p99       99th percentile of edge length / rest length - 1
    calm_mm          prediction's motion - truth's, where the truth's is below 5 mm: an idle garment must not breathe
    jitter           ratio: rms of the second difference over time in the hips' frame, prediction's over truth's;
                     held_mm: how far vertices move a tick while a pose is held
"""
import numpy as np
import scipy.sparse

WARM_UP = 12            # frames of a clip that do not count: a garment begins at rest
SMOOTHED = (8, 40)      # steps that separate fine from middle from coarse
BANDS = ("coarse", "middle", "fine")
CALM = 5.0              # mm of motion: the cloth hardly moves
_BLOCK = 16             # frames smoothed together, so that they stay in the cache


def counted(frames):
    """The first frame that counts: WARM_UP, or 0 in a clip that is no longer than that."""
    return WARM_UP if frames > WARM_UP else 0


def distances_mm(positions, truth):
    """Vertex distances [T, n] in millimetres."""
    return 1e3 * np.linalg.norm(np.asarray(positions, np.float64) - truth, axis=-1)


def vertex_normals(positions, faces):
    """Unit normals [T, n, 3]: face normals summed, so weighted by area; zero where undefined."""
    a, b, c = (np.asarray(positions, np.float64)[:, faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    out = np.zeros(positions.shape)
    for t in range(len(out)):
        for axis in range(3):
            out[t, :, axis] = sum(np.bincount(faces[:, i], across[t, :, axis], out.shape[1])
                                  for i in range(3))
    length = np.linalg.norm(out, axis=-1, keepdims=True)
    return np.divide(out, length, out=np.zeros_like(out), where=length > 0)


def angles_degrees(normals, other):
    """Angles [T, n] between unit normals; NaN where either is undefined.

    atan2 of |a x b| and a . b: arccos loses all digits for small angles.
    """
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(normals, other), axis=-1),
                                  (normals * other).sum(-1)))
    angle[~(normals.any(-1) & other.any(-1))] = np.nan
    return angle


def errors(distance, angle):
    """{position_mm: {mean, std, p99, max}, normal_deg: {mean, std, p99}} of distances [T, n] mm and angles [T, n]
    degrees.

    Angles that are undefined are NaN. std is over the frames' means, p99 over all vertices of all frames.
    """
    frames = [row[~np.isnan(row)] for row in angle]
    known = np.concatenate(frames)
    means = [row.mean() for row in frames if len(row)]
    return {"position_mm": {"mean": float(distance.mean()), "std": float(distance.mean(1).std()),
                            "p99": float(np.percentile(distance, 99)), "max": float(distance.max())},
            "normal_deg": {"mean": float(known.mean()), "std": float(np.std(means)),
                           "p99": float(np.percentile(known, 99))} if len(known) else
            {"mean": 0.0, "std": 0.0, "p99": 0.0}}


def in_hips(positions, hips):
    """Positions [T, n, 3] in the frames of the hips' joint [T, 4, 4]."""
    hips = np.asarray(hips, np.float64)
    return np.einsum("tji,tnj->tni", hips[:, :3, :3], positions - hips[:, None, :3, 3])


def _length_mm(vectors):
    return 1e3 * float(np.linalg.norm(vectors, axis=-1).mean())


def _rms_mm(vectors):
    return 1e3 * float(np.sqrt(np.square(vectors, dtype=np.float64).sum(-1).mean())) if vectors.size else 0.0


def _about_mean(shapes):
    return shapes - shapes.mean(0)


def alive_mm(positions, hips):
    """Mean distance in mm of cloth [T, n, 3] from its mean shape in the frames of the hips [T, 4, 4]."""
    return _length_mm(_about_mean(in_hips(positions, hips)))


def edges_of(faces):
    """Unique undirected edges [e, 2] of triangles [c, 3]."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


class Mesh:
    """A garment's topology and rest shape: what its measures need besides the frames.

    faces [c, 3]; rest [n, 3] m: lengths without strain, or rest_length [e] m of edges_of(faces).
    """

    def __init__(self, faces, rest, rest_length=None):
        self.faces, self.edges = np.asarray(faces), edges_of(np.asarray(faces))
        count = len(rest)
        if rest_length is None:
            rest_length = np.linalg.norm(np.subtract(*np.asarray(rest, np.float64)[self.edges.T]), axis=1)
        self.rest_length = np.asarray(rest_length, np.float64)
        both = np.concatenate([self.edges, self.edges[:, ::-1]])
        links = scipy.sparse.csr_matrix((np.ones(len(both), np.float32), (both[:, 0], both[:, 1])), (count, count))
        degree = np.asarray(links.sum(1)).ravel()
        share = scipy.sparse.diags((0.5 / np.maximum(degree, 1)).astype(np.float32))
        own = scipy.sparse.diags(np.where(degree > 0, 0.5, 1.0).astype(np.float32))
        self._step = (own + share @ links).tocsr()

    def bands(self, shapes):
        """[coarse, middle, fine], [T, n, 3] float32 each: they sum to `shapes`. 10 ms a frame of 8,000 vertices."""
        shapes = np.asarray(shapes, np.float32)
        out = [np.empty_like(shapes) for _ in BANDS]
        for at in range(0, len(shapes), _BLOCK):
            part = shapes[at:at + _BLOCK]
            flat, kept = np.ascontiguousarray(part.transpose(1, 0, 2)).reshape(part.shape[1], -1), []
            for step in range(1, SMOOTHED[1] + 1):
                flat = self._step @ flat
                if step in SMOOTHED:
                    kept.append(flat.reshape(part.shape[1], len(part), 3).transpose(1, 0, 2))
            little, much = kept
            for band, value in zip(out, (much, little - much, part - little)):
                band[at:at + _BLOCK] = value
        return out

    def strain(self, positions):
        """Edge length / rest length - 1, [T, e]."""
        a, b = (np.asarray(positions, np.float64)[:, self.edges[:, k]] for k in (0, 1))
        return np.linalg.norm(a - b, axis=-1) / self.rest_length - 1


def fine_motion_mm(positions, hips, mesh):
    """Mean length in mm of what 40 steps of averaging take from cloth [T, n, 3], about its mean, in the hips' frame."""
    coarse, middle, fine = mesh.bands(_about_mean(in_hips(positions, hips)))
    return _length_mm(middle + fine)


class Truth:
    """The truth of one clip, with what every prediction of it is compared to. positions [T, n, 3] m, hips [T, 4, 4]."""

    def __init__(self, positions, hips, mesh):
        first = counted(len(positions))
        self.mesh, self.first, self.frames = mesh, first, len(positions) - first
        self.positions = np.asarray(positions)[first:].astype(np.float64)
        self.hips = np.asarray(hips, np.float64)[first:]
        self.normals = vertex_normals(self.positions, mesh.faces)
        self.local = in_hips(self.positions, self.hips)
        self.motion = _about_mean(self.local)
        self.bands = mesh.bands(self.motion)
        self.alive_mm = _length_mm(self.motion)
        self.second_mm = _rms_mm(np.diff(self.local, 2, axis=0))

    def measures(self):
        """What the truth is by itself: alive_mm, fine_motion_mm, strain_p99."""
        return {"frames": self.frames, "alive_mm": self.alive_mm,
                "fine_motion_mm": _length_mm(self.bands[1] + self.bands[2]),
                "strain_p99": float(np.percentile(self.mesh.strain(self.positions), 99)),
                "jitter": {"rms_mm": self.second_mm}}


def _quotient(over, under):
    return float(over / under) if under > 0 else None


def clip(predicted, truth):
    """Measures of a prediction [T, n, 3] m against a Truth of T frames; not penetration, crossings, jitter.held_mm."""
    predicted = np.asarray(predicted)
    if predicted.shape != (truth.first + truth.frames,) + truth.positions.shape[1:]:
        raise ValueError(f"a prediction of shape {list(predicted.shape)}; the truth has "
                         f"{truth.first + truth.frames} frames of {list(truth.positions.shape[1:])}")
    predicted = predicted[truth.first:].astype(np.float64)
    mesh, distance = truth.mesh, distances_mm(predicted, truth.positions)
    angle = angles_degrees(vertex_normals(predicted, mesh.faces), truth.normals)
    local = in_hips(predicted, truth.hips)
    motion = _about_mean(local)
    alive, second = _length_mm(motion), _rms_mm(np.diff(local, 2, axis=0))
    motion_error = _length_mm(motion - truth.motion)
    bands = {}
    # Smoothing is linear: a band of the difference of motions gives the prediction's own band too.
    offset = local.mean(0) - truth.local.mean(0)
    for name, moving, still, of_truth in zip(BANDS, mesh.bands(motion - truth.motion), mesh.bands(offset[None]),
                                             truth.bands):
        own, wanted = _rms_mm(moving + of_truth), _rms_mm(of_truth)
        bands[name] = {"error_mm": _length_mm(moving + still), "rms_mm": own, "truth_rms_mm": wanted,
                       "energy_ratio": _quotient(own, wanted)}
    return {
        "frames": truth.frames,
        **errors(distance, angle),
        "alive_mm": truth.alive_mm, "predicted_alive_mm": alive,
        "relative_error": _quotient(distance.mean(), truth.alive_mm),
        "offset_mm": _length_mm(offset), "motion_error_mm": motion_error,
        "relative_motion_error": _quotient(motion_error, truth.alive_mm),
        "bands": bands,
        "strain_p99": float(np.percentile(mesh.strain(predicted), 99)),
        "calm_mm": alive - truth.alive_mm if truth.alive_mm < CALM else None,
        "jitter": {"ratio": _quotient(second, truth.second_mm), "rms_mm": second, "truth_rms_mm": truth.second_mm}}


def held_mm(positions):
    """How far vertices move a tick, mean in mm, in positions [T, n, 3] of a pose that is held."""
    return _length_mm(np.diff(np.asarray(positions, np.float64), axis=0))


_MEANS = (("position_mm", "mean"), ("position_mm", "std"), ("position_mm", "p99"), ("normal_deg", "mean"),
          ("normal_deg", "std"), ("alive_mm",), ("predicted_alive_mm",), ("offset_mm",), ("motion_error_mm",),
          ("fine_motion_mm",), ("strain_p99",), ("calm_mm",), ("penetration", "area_share"), ("penetration", "p99_mm"),
          ("crossings", "cloth"), ("crossings", "body"), ("jitter", "held_mm")) + tuple(
              ("bands", name, "error_mm") for name in BANDS)


def _at(measures, path):
    for key in path:
        measures = (measures or {}).get(key)
    return measures


def _put(out, path, value):
    for key in path[:-1]:
        out = out.setdefault(key, {})
    out[path[-1]] = value


def over_clips(rows):
    """Measures of several clips from each clip's: the same keys. Left out: what no clip has."""
    rows, out = list(rows), {"clips": len(rows), "frames": sum(row.get("frames", 0) for row in rows)}
    for path in _MEANS:
        known = [value for value in (_at(row, path) for row in rows) if value is not None]
        if known:
            _put(out, path, float(np.mean(known)))
    highest = [value for value in (_at(row, ("position_mm", "max")) for row in rows) if value is not None]
    if highest:
        _put(out, ("position_mm", "max"), max(highest))
    for key, over in (("relative_error", ("position_mm", "mean")), ("relative_motion_error", ("motion_error_mm",))):
        if _at(out, over) is not None and "alive_mm" in out:
            out[key] = _quotient(_at(out, over), out["alive_mm"])
    for path, quotient in ((("jitter",), "ratio"), *((("bands", name), "energy_ratio") for name in BANDS)):
        own, wanted = ([value for value in (_at(row, (*path, key)) for row in rows) if value is not None]
                       for key in ("rms_mm", "truth_rms_mm"))
        if own and len(own) == len(wanted):
            own, wanted = (float(np.sqrt(np.mean(np.square(values)))) for values in (own, wanted))
            _put(out, (*path, "rms_mm"), own)
            _put(out, (*path, "truth_rms_mm"), wanted)
            _put(out, (*path, quotient), _quotient(own, wanted))
    return out
