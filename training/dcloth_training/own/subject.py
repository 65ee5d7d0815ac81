"""What simulate/run.py simulates where a character of the user's own is named: body, garment, clips, drapes."""
import dataclasses
import json
import os

import numpy as np

from .. import command, safetensors_io
from ..simulate import cloth_job, settings, statics
from ..truth.errors import refuse
from . import dress, hero as heroes, motions

# A garment that hangs through the body from the start has been modelled so.
DEEPEST_MM = 30.0
PUT_ON = cloth_job.PUT_ON_FRAMES + cloth_job.HANG_FRAMES    # frames that a garment is put on for


def add_arguments(add):
    """The options of a character of one's own."""
    add("--character", help="a character of your own (.glb, .gltf, .vrm, .fbx); --garment is then a mesh on it in its "
                            "bind pose (dress.obj, dress.glb or file.glb#MESH) and --clips names clips of it, files "
                            "such as walk.fbx or clips.glb#Run, and procedural/NAME")
    add("--fabric", choices=sorted(settings.FABRICS), default="wool", help="of your own garment")
    add("--pin", help="what follows the skin: top (the highest border on the skin), colour:red (vertex colours; also "
                      "green, blue, black, white), bone:hips,spine (what touches these), none. Default: red vertices, "
                      "or the top")
    add("--refine", type=int, choices=(0, 1, 2), default=0, help="times that every triangle is cut in four")
    add("--body-meshes", nargs="+", metavar="MESH", help="skinned meshes that make the body; all when not given")
    add("--garment-unit", default="m", help="of an .obj: m, cm, mm, in, ft or metres in a unit")
    add("--garment-up", choices=("y", "z"), default="y", help="up axis of an .obj; z: Blender's axes")
    add("--unit", help="of the character's file, where it does not say so or is wrong")
    add("--up", choices=("y", "z"), help="up axis of the character's file")
    add("--map", help='JSON: {"left upper leg": "node of the file", ...} where joints have other names')
    add("--held-out", default="", help="clips that no drape is taken from, comma separated")
    add("--dcloth", help="the built dcloth command; found in build/ and the PATH when not given")


def sort_out(options):
    """Names of clips that --held-out means."""
    return [name for name in options.held_out.split(",") if name]


class Own:
    """A character and a garment from files."""
    windy = False       # a first look has too few clips to learn wind from

    def __init__(self, options):
        self.options = options
        os.makedirs(options.out, exist_ok=True)
        self.body, told = heroes.read(options, options.out)
        print(f"{os.path.basename(options.character)}: {told}", flush=True)
        self.made = dress.make(options.garment, self.body, options.fabric, options.pin, options.garment_unit,
                               options.garment_up, options.refine)
        self.worn = self.made.worn
        for line in self.made.told:
            print(f"{self.worn.name}: {line}", flush=True)
        for line in self.made.warnings:
            print(f"{self.worn.name}: warning: {line}", flush=True)
        self.clips = motions.Clips(options, self.body, options.out)
        self.felt = [self.body.names.index(name) for name in self.worn.felt]

    def put_on(self):
        """(body, garment as it hangs in bind pose), from character.safetensors or simulated and written there."""
        path = os.path.join(self.options.out, "character.safetensors")
        if os.path.exists(path):
            tensors, metadata = safetensors_io.read(path)
            hanging = tensors["cloth_template"].astype(np.float64)
            if hanging.shape != self.worn.vertices.shape or not np.array_equal(tensors["cloth_faces"], self.worn.faces):
                refuse(path, f"another garment of {len(hanging):,} vertices", f"that of {self.options.garment}, "
                       f"{len(self.worn.vertices):,}", "name another --out for each garment")
            if list(self.body.names) != json.loads(metadata["joint_names"]) or \
                    not np.array_equal(tensors["body_vertices"], self.body.vertices.astype(np.float32)):
                refuse(path, "another character, or the same one in another state", self.options.character,
                       "name another --out for each character")
            return self.body, dataclasses.replace(self.worn, vertices=hanging)
        modelled = self.worn.vertices
        worn, moving, _ = cloth_job.hung(self.worn, self.body)
        sunk = np.linalg.norm(worn.vertices - modelled, axis=1)
        print(f"{worn.name}: hanging, it moves {1e3 * moving:.3f} mm a frame; vertices hang {1e3 * sunk.mean():.0f} mm "
              f"from where they were modelled (mean), at most {1e3 * sunk.max():.0f}", flush=True)
        self._check(worn)
        _, _, _, masks = cloth_job.collider(self.body, worn)
        safetensors_io.write(path, {
            "joint_bind": self.body.bind.astype(np.float32), "body_vertices": self.body.vertices.astype(np.float32),
            "body_faces": self.body.faces.astype(np.int32), "body_weights": self.body.weights.astype(np.float32),
            "body_collider": (masks > 0).astype(np.uint8), "cloth_template": worn.vertices.astype(np.float32),
            "cloth_faces": worn.faces, "cloth_rest_length": cloth_job.rest_lengths(worn).astype(np.float32),
            **({} if worn.texture is None else {"cloth_texture": worn.texture}),
            "pinned": worn.pinned.astype(np.uint8), "cloth_touches": worn.touches.astype(np.int32),
            "body_parts": masks.astype(np.int32)},
            {"joint_names": json.dumps(self.body.names), "parents": json.dumps(self.body.parents.tolist()),
             "hips": self.body.names[0], "feature_joints": json.dumps(worn.felt)})
        write_obj(os.path.join(self.options.out, "garment.obj"), worn)
        return self.body, dataclasses.replace(worn, vertices=worn.vertices.astype(np.float32).astype(np.float64))

    def _check(self, worn):
        from ..simulate import checks       # needs libigl, which clips need too

        if not np.isfinite(worn.vertices).all() or np.abs(worn.vertices - self.body.joints[0]).max() > 5:
            refuse(self.options.garment, "a garment that fell off or came apart in the bind pose", "one that stays on",
                   "pin its waistband or neckline (--pin)")
        referee = checks.referee(self.body, worn)
        depth, own, _ = referee.frame(worn.vertices, self.body.vertices)
        at = int(depth.argmax())
        print(f"{worn.name}: in bind pose at most {1e3 * depth.max():.1f} mm under the skin, {len(own)} crossings of "
              "its own",
              flush=True)
        if 1e3 * depth.max() > DEEPEST_MM:
            refuse(self.options.garment, f"cloth {1e3 * depth.max():.0f} mm under the skin at "
                                         f"{np.round(worn.vertices[at], 3)} m "
                   "after hanging", f"{DEEPEST_MM:.0f} mm",
                   "model it outside of the body, or leave that mesh out of the body "
                   "(--body-meshes)")

    def group(self, word):
        return self.clips.pieces(word)

    def motion(self, name):
        return self.clips.load(name)

    def drapes(self):
        """Poses of the drapes, of the clips that are not held out."""
        apart = sort_out(self.options)
        names = [name for word in self.options.clips.split(",") if word != "static" for name in self.group(word)
                 if name not in apart and name.partition("@")[0] not in apart]
        if not names:
            refuse("--clips", self.options.clips, "clips beside 'static' that are not held out",
                   "name some, e.g. procedural")
        poses = statics.select([self.motion(name) for name in names], self.options.poses, self.felt)
        return statics.order(poses, self.felt)


def write_obj(path, worn):
    """The garment as it hangs, with the texture coordinates of its file: what a game draws."""
    command.folder_of(path)
    with open(path + ".part", "w", encoding="ascii") as file:
        for point in worn.vertices:
            file.write("v {:.6f} {:.6f} {:.6f}\n".format(*point))
        if worn.texture is None:
            for face in worn.faces + 1:
                file.write("f {} {} {}\n".format(*face))
        else:
            places, corner = np.unique(worn.texture.reshape(-1, 2), axis=0, return_inverse=True)
            for u, v in places:
                file.write(f"vt {u:.6f} {1 - v:.6f}\n")
            for face, at in zip(worn.faces + 1, corner.reshape(-1, 3) + 1, strict=True):
                file.write("f " + " ".join(f"{vertex}/{place}" for vertex, place in zip(face, at, strict=True)) + "\n")
    os.replace(path + ".part", path)
