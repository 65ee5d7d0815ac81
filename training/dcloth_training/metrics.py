"""The two error measures of the paper (eq. 19): E_d in millimetres, E_n in degrees."""
import numpy as np


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


def summary(positions, truth, faces):
    """{position_mm: {mean, std, p99, max}, normal_deg: {mean, std, p99}}.

    std is over the frames' means, p99 over all vertices of all frames.
    """
    d = distances_mm(positions, truth)
    angle = angles_degrees(vertex_normals(positions, faces), vertex_normals(truth, faces))
    frame_angle = np.nanmean(angle, axis=1)
    return {"position_mm": {"mean": float(d.mean()), "std": float(d.mean(1).std()),
                            "p99": float(np.percentile(d, 99)), "max": float(d.max())},
            "normal_deg": {"mean": float(np.nanmean(angle)), "std": float(frame_angle.std()),
                           "p99": float(np.nanpercentile(angle, 99))}}
