"""Writes worlds with exporters that are not ours: `make.py FOLDER`.

yard.glb        trimesh: several named meshes, one textured, one coloured by corner, a gate; y up as glTF has it
tagged.gltf     the same through pygltflib: tags in extras, a start, buffers and pictures in files beside it
"""

import math
import sys
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image
from pygltflib import GLTF2, BufferFormat, ImageFormat, Node
from trimesh.transformations import rotation_matrix, translation_matrix
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals


def at(mesh, east, north, up):
    return mesh.apply_transform(translation_matrix([east, north, up]))


def painted(mesh, colour, roughness=0.9):
    """`colour` is sRGB, 0 to 255; factors are linear."""
    linear = [(c / 255) ** 2.2 for c in colour]
    material = PBRMaterial(baseColorFactor=[*linear, 1.0], metallicFactor=0.0, roughnessFactor=roughness)
    mesh.visual = TextureVisuals(material=material)
    return mesh


def paving():
    """A square of 80 m with a picture on it that repeats every 4 m."""
    side, repeats = 40.0, 20.0
    corners = [[-side, -side, 0], [side, -side, 0], [side, side, 0], [-side, side, 0]]
    uv = [[0, 0], [repeats, 0], [repeats, repeats], [0, repeats]]
    pixels = np.full((128, 128, 3), (150, 145, 135), np.uint8)
    pixels[:64, :64] = pixels[64:, 64:] = (120, 118, 112)
    pixels[::64, :] = pixels[:, ::64] = (70, 68, 65)
    material = PBRMaterial(baseColorTexture=Image.fromarray(pixels), metallicFactor=0.0, roughnessFactor=1.0)
    visual = TextureVisuals(uv=np.array(uv), material=material)
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)


def car():
    body = trimesh.creation.box([4.2, 1.8, 0.9])
    cabin = trimesh.creation.box([2.2, 1.6, 0.6])
    return painted(trimesh.util.concatenate([at(body, 0, 0, 0.65), at(cabin, -0.2, 0, 1.4)]), (190, 20, 15), 0.3)


def crate():
    """Wooden boards as a picture on each side."""
    mesh = trimesh.creation.box([2, 2, 2])
    mesh.unmerge_vertices()
    rows = np.arange(64)[:, None, None]
    board = np.where(rows % 16 < 2, 0.45, 1.0) * np.array([170, 120, 70])
    pixels = np.broadcast_to(board, (64, 64, 3)).astype(np.uint8)
    across = np.array([[1, 2] if abs(n[0]) > 0.5 else [0, 2] if abs(n[1]) > 0.5 else [0, 1] for n in mesh.face_normals])
    uv = np.array([(mesh.vertices[i][across[f]] + 1) / 2 for f, face in enumerate(mesh.faces) for i in face])
    order = mesh.faces.reshape(-1)
    flat = np.zeros((len(mesh.vertices), 2))
    flat[order] = uv
    material = PBRMaterial(baseColorTexture=Image.fromarray(pixels), metallicFactor=0.0, roughnessFactor=1.0)
    mesh.visual = TextureVisuals(uv=flat, material=material)
    return at(mesh, 0, 0, 1)


def ball():
    """Coloured by corner, as scans are: green below, yellow above."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=1.5)
    share = (mesh.vertices[:, 2:3] / 1.5 + 1) / 2
    mesh.visual.vertex_colors = np.hstack([40 + 200 * share, 140 + 60 * share, 30 + 10 * share, 255 + 0 * share]).astype(np.uint8)
    return at(mesh, 0, 0, 1.5)


def gate():
    posts = [at(trimesh.creation.box([0.4, 0.4, 5]), x, 0, 2.5) for x in (-2.7, 2.7)]
    lintel = at(trimesh.creation.box([5.8, 0.4, 0.5]), 0, 0, 5.25)
    return painted(trimesh.util.concatenate([*posts, lintel]), (235, 130, 20))


def opening():
    corners = [[-2.5, 0, 0], [2.5, 0, 0], [2.5, 0, 5], [-2.5, 0, 5]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def scene(with_opening):
    things = {
        "Ground": (paving(), 0, 0, 0),
        "Red_Car.001": (car(), 8, 22, -25),
        "WoodenCrate": (crate(), -7, 12, 30),
        "green ball": (ball(), -14, 26, 0),
        "Gate": (gate(), 0, 14, 0),
        "Tower": (painted(trimesh.creation.cylinder(2.0, 18, sections=32).apply_translation([0, 0, 9]), (225, 225, 220)), -22, 34, 0),
    }
    if with_opening:
        things["Gate Opening"] = (opening(), 0, 14, 0)
    out = trimesh.Scene()
    for name, (mesh, east, north, turn) in things.items():
        place = translation_matrix([east, north, 0]) @ rotation_matrix(math.radians(turn), [0, 0, 1])
        out.add_geometry(mesh, node_name=name, geom_name=name, transform=place)
    # What is z up here is y up in glTF.
    out.apply_transform(rotation_matrix(-math.pi / 2, [1, 0, 0]))
    return out


def tagged(folder):
    """Extras, a start and files beside the file."""
    scene(True).export(folder / "plain.glb")
    model = GLTF2().load(str(folder / "plain.glb"))
    extras = {
        "Red_Car.001": {"spf": {"names": ["hatchback", "car"], "colour": "red", "kind": "vehicle", "use": ["drive to work"]}},
        "Gate": {"spf_names": "archway, gate", "spf_kind": "structure"},
        "Gate Opening": {"spf_names": "archway opening", "spf_opening": 1, "spf_opening_of": "Gate"},
        "green ball": {"spf_solid": False},
        "Tower": {"spf_ignore": True},
    }
    for node in model.nodes:
        node.extras = extras.get(node.name, {})
    # 18 m south of the middle, facing north: along its own -z, which is north already.
    model.nodes.append(Node(name="spf_start", translation=[2.0, 0.0, 18.0]))
    model.scenes[0].nodes.append(len(model.nodes) - 1)
    model.scenes[0].extras = {"spf_name": "tagged yard", "spf_craft": "quad", "spf_success_radius_m": 3.0}
    model.convert_images(ImageFormat.FILE, str(folder))
    model.convert_buffers(BufferFormat.BINFILE)
    model.save(str(folder / "tagged.gltf"))


def main():
    folder = Path(sys.argv[1])
    scene(False).export(folder / "yard.glb")
    tagged(folder)


main()
