#!/usr/bin/env python3
"""The bundled skirt in Panda3D, without a window: plays a sequence, draws skirt and figure, writes PNG pictures.

    pip install platforms/python panda3d safetensors
    dcloth convert models/skirt/skirt.safetensors -o skirt.dcloth --precision int8
    python platforms/python/examples/panda3d_skirt.py skirt.dcloth models/skirt/skirt.safetensors \
        models/skirt/sequences/walk_turn.safetensors -o pictures
"""
from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import dcloth
import numpy as np
from direct.showbase.ShowBase import ShowBase
from panda3d import core
from safetensors import safe_open

SIZE = 720  # pixels of a picture's edge; it is drawn twice as large and reduced, which smooths edges


def mesh(vertex_count: int, triangles: np.ndarray, colours: np.ndarray) -> core.Geom:
    """Positions and normals interleaved in one array, colours in a second, which stays."""
    vertex_format = core.GeomVertexFormat()
    vertex_format.add_array(core.GeomVertexFormat.get_v3n3().get_array(0))
    vertex_format.add_array(core.GeomVertexArrayFormat("color", 4, core.Geom.NT_uint8, core.Geom.C_color))
    data = core.GeomVertexData("mesh", core.GeomVertexFormat.register_format(vertex_format), core.Geom.UH_dynamic)
    data.set_num_rows(vertex_count)
    bytes_of(data, 1)[:] = np.round(colours * 255).astype(np.uint8)
    faces = core.GeomTriangles(core.Geom.UH_static)
    faces.set_index_type(core.Geom.NT_uint16)
    faces_data = faces.modify_vertices()
    faces_data.set_num_rows(triangles.size)
    np.frombuffer(memoryview(faces_data), np.uint16)[:] = triangles.ravel()
    faces.close_primitive()
    geom = core.Geom(data)
    geom.add_primitive(core.GeomTriangles(faces))
    return geom


def bytes_of(data: core.GeomVertexData, array: int) -> np.ndarray:
    return np.frombuffer(memoryview(data.modify_array(array)), np.uint8).reshape(data.get_num_rows(), -1)


def vertex_buffer(geom: core.Geom) -> tuple[np.ndarray, np.ndarray]:
    """Positions and normals in Panda3D's own buffer, [n, 3] each, 24 bytes from one to the next. For one frame."""
    rows = np.frombuffer(memoryview(geom.modify_vertex_data().modify_array(0)), np.float32).reshape(-1, 6)
    return rows[:, :3], rows[:, 3:]


class Rig:
    """The character's joints as nodes, as `Actor.expose_joint` gives them in a game. Here a sequence moves them."""

    def __init__(self, parent: core.NodePath, path: str) -> None:
        with safe_open(path, "np") as file:
            self.names: list[str] = json.loads(file.metadata()["joint_names"])
            self.fps = float(file.metadata()["fps"])
            self.poses = file.get_tensor("joint_matrices")  # [T, J, 4, 4]
        self.nodes = [parent.attach_new_node(name) for name in self.names]

    def move(self, frame: int) -> None:
        for node, matrix in zip(self.nodes, self.poses[frame]):
            node.set_mat(core.LMatrix4f(*matrix.T.ravel()))  # Panda3D's matrices act on row vectors

    def matrices(self) -> np.ndarray:
        """[J, 4, 4] float32 as Panda3D keeps them: what dcloth calls column_major."""
        return np.array([node.get_net_transform().get_mat() for node in self.nodes], np.float32)


class Skirt:
    def __init__(self, parent: core.NodePath, model: dcloth.Model, rig: Rig) -> None:
        self.cloth = dcloth.Cloth(model)
        self.cloth.bind_joints(rig.names)
        white = np.ones((model.vertex_count, 4))
        self.geom = mesh(model.vertex_count, model.triangles, white)
        self.node = core.GeomNode("skirt")
        self.node.add_geom(self.geom)
        outside = parent.attach_new_node(self.node)
        outside.set_color_scale(0.75, 0.33, 0.38, 1)
        # Fixed-function lighting knows one side: the lining is drawn apart, darker.
        self.lining = core.GeomNode("lining")
        self.lining.add_geom(self.geom)
        inside = parent.attach_new_node(self.lining)
        inside.set_attrib(core.CullFaceAttrib.make_reverse())
        inside.set_light_off()
        inside.set_color_scale(0.24, 0.07, 0.1, 1)

    def update(self, rig: Rig, seconds: float) -> None:
        geom = self.node.modify_geom(0)
        positions, normals = vertex_buffer(geom)
        self.cloth.update(rig.matrices(), seconds, column_major=True, outside_body=OUTSIDE_BODY, positions=positions,
                          normals=normals)
        self.lining.modify_geom(0).set_vertex_data(geom.get_vertex_data())
        for node in (self.node, self.lining):
            node.mark_internal_bounds_stale()

    def drawn(self) -> np.ndarray:
        """[n, 3] what is in the vertex buffer."""
        return vertex_buffer(self.node.modify_geom(0))[0].copy()


class Figure:
    """The training figure's skin out of the bundle, skinned on the CPU."""

    def __init__(self, parent: core.NodePath, bundle: str, rig: Rig) -> None:
        with safe_open(bundle, "np") as file:
            names = json.loads(file.metadata()["joint_names"])
            positions, faces = file.get_tensor("body.positions"), file.get_tensor("body.faces")
            self.weights = file.get_tensor("body.joint_weights")
            self.inverse_binds = np.linalg.inv(file.get_tensor("character.bind"))
            coloured = "body.colours" in set(file.keys())
            colours = file.get_tensor("body.colours") if coloured else np.full_like(positions, 0.7)
        self.order = [rig.names.index(name) for name in names]
        self.rest = np.concatenate([positions, np.ones((len(positions), 1), np.float32)], 1)
        corners = positions[faces]
        face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.normals = np.zeros_like(positions)
        for corner in range(3):
            np.add.at(self.normals, faces[:, corner], face_normals)
        self.node = core.GeomNode("figure")
        self.node.add_geom(mesh(len(positions), faces.astype(np.uint16), np.c_[colours, np.ones(len(colours))]))
        parent.attach_new_node(self.node)

    def update(self, rig: Rig) -> None:
        joints = rig.matrices().transpose(0, 2, 1)[self.order] @ self.inverse_binds
        matrices = np.tensordot(self.weights, joints[:, :3], 1)  # [b, 3, 4]
        positions, normals = vertex_buffer(self.node.modify_geom(0))
        positions[:] = np.einsum("brc,bc->br", matrices, self.rest)
        turned = np.einsum("brc,bc->br", matrices[:, :, :3], self.normals)
        normals[:] = turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12)
        self.node.mark_internal_bounds_stale()


class Stage:
    """An offscreen scene with lights, a floor and a camera that keeps the hips in sight."""

    def __init__(self, renderer: str) -> None:
        # Without the two lines on transforms Panda3D gives a node an earlier transform that differs by less than a
        # millionth. Nobody sees that; the test that compares with a C++ host does (0.16 mm at one vertex).
        core.load_prc_file_data("", f"""
            window-type offscreen
            load-display {renderer}
            aux-display
            win-size {2 * SIZE} {2 * SIZE}
            coordinate-system yup-right
            uniquify-transforms 0
            transform-cache 0
            audio-library-name null
            notify-level-device fatal
            notify-level-x11display fatal
            notify-level-tinydisplay error
            """)
        self.base = ShowBase()
        self.root = self.base.render
        self.base.set_background_color(0.85, 0.87, 0.9)
        self.base.camLens.set_fov(32)
        self.base.camLens.set_near_far(0.1, 900)
        self.add_light(core.AmbientLight("sky"), 0.4)
        self.add_light(core.DirectionalLight("sun"), 0.8, (-2.4, -1.6, -0.6))
        self.add_light(core.DirectionalLight("window"), 0.2, (2, -0.5, -1))
        floor = core.CardMaker("floor")
        floor.set_frame(-400, 400, -400, 400)
        floor = self.root.attach_new_node(floor.generate())
        floor.look_at(0, -1, 0)
        floor.set_two_sided(True)
        floor.set_light_off()
        floor.set_color(0.7, 0.72, 0.75, 1)

    def add_light(self, light: core.Light, strength: float,
                  direction: tuple[float, float, float] | None = None) -> None:
        light.set_color((strength, strength, strength, 1))
        if direction:
            light.set_direction(core.LVector3(*direction))
        self.root.set_light(self.root.attach_new_node(light))

    def picture(self, hips: np.ndarray) -> core.PNMImage:
        x, _, z = (float(value) for value in hips)
        self.base.camera.set_pos(x + 1.4, 1.3, z + 3.6)
        self.base.camera.look_at(core.LPoint3(x, 0.85, z), core.LVector3(0, 1, 0))
        self.base.graphicsEngine.render_frame()
        large = core.PNMImage()
        if not self.base.win.get_screenshot(large):
            raise SystemExit("panda3d_skirt: Panda3D drew no picture; try --renderer p3tinydisplay")
        small = core.PNMImage(SIZE, SIZE)
        small.quick_filter_from(large)
        return small


OUTSIDE_BODY = True  # dcloth_output.flags of dcloth.h: vertices are pushed out of the figure's skin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", help="a .dcloth model")
    parser.add_argument("bundle", help="its training bundle, for the figure's skin")
    parser.add_argument("sequence", help="a sequence (.safetensors)")
    parser.add_argument("-o", "--output", required=True, help="the folder for frame_NNNN.png")
    parser.add_argument("--every", type=int, default=15, help="draw every n-th frame (default: 15)")
    parser.add_argument("--renderer", default="p3tinydisplay", help="p3tinydisplay draws in software, without a GPU")
    parser.add_argument("--vertices", help="also write the vertex buffer of each drawn frame (.npy, [T, n, 3])")
    options = parser.parse_args()

    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    stage = Stage(options.renderer)
    rig = Rig(stage.root, options.sequence)
    skirt = Skirt(stage.root, dcloth.Model(options.model), rig)
    figure = Figure(stage.root, options.bundle, rig)
    drawn = []
    for frame in range(len(rig.poses)):
        rig.move(frame)
        skirt.update(rig, 1 / rig.fps)
        if frame % options.every:
            continue
        figure.update(rig)
        hips = rig.poses[frame, rig.names.index("Hips"), :3, 3]
        stage.picture(hips).write(core.Filename.from_os_specific(str(folder / f"frame_{frame:04}.png")))
        drawn.append(skirt.drawn())
    if options.vertices:
        np.save(options.vertices, np.array(drawn))
    print(f"{folder}: {len(drawn)} pictures, {skirt.cloth.model!r}", file=sys.stderr)


if __name__ == "__main__":
    main()
