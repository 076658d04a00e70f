"""Meshes of a scene estimate as files: one PLY per object, one GLB of the scene."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import MissingDependencyError
from scenefw.core.files import replacing
from scenefw.core.types import Float32, SceneEstimate, TriangleMesh
from scenefw.export.surface_colours import surface_colours

Colour = Sequence[float]

_MATT = {"metallicFactor": 0.0, "roughnessFactor": 0.7}
_Y_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def write_ply(
    path: Path,
    mesh: TriangleMesh,
    colour: Colour | NDArray[np.float64] | None = None,
    spread: Float32 | None = None,
) -> None:
    """Writes a mesh as binary little-endian PLY: float32 metres, world coordinates (z up).

    Args:
        path: the file, replaced as a whole.
        mesh: triangles.
        colour: red, green, blue in [0, 1] of all vertices, or (V, 3) of each.
        spread: (V,) of hypotheses at each vertex (m), written as `spread`; None: left out.
    """
    fields = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
    if colour is not None:
        fields += [("red", "u1"), ("green", "u1"), ("blue", "u1")]
    if spread is not None:
        fields.append(("spread", "<f4"))
    vertices = np.empty(len(mesh.vertices), dtype=fields)
    for axis, name in enumerate("xyz"):
        vertices[name] = mesh.vertices[:, axis]
    if colour is not None:
        rgb = _bytes(np.broadcast_to(colour, (len(vertices), 3)))
        for channel, name in enumerate(("red", "green", "blue")):
            vertices[name] = rgb[:, channel]
    if spread is not None:
        vertices["spread"] = spread
    faces = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    names = {"<f4": "float", "u1": "uchar"}
    properties = "".join(f"property {names[kind]} {name}\n" for name, kind in fields)
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment metres, z up\n"
        f"element vertex {len(vertices)}\n{properties}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + vertices.tobytes() + faces.tobytes())


def write_glb(path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
    """Writes all objects of an estimate as one GLB; glTF is y-up, so world z becomes its y.

    Each object is a node `object_01`, ... with a material, and the colours of the image on its
    vertices (`surface_colours`), or its own colour where there are none.

    Args:
        path: the file, replaced as a whole.
        estimate: its objects' meshes, world coordinates (m).
        colours: red, green, blue in [0, 1] of each object, in their order.

    Raises:
        MissingDependencyError: trimesh is not installed.
    """
    try:
        import trimesh
    except ImportError as error:
        raise MissingDependencyError("GLB files need: pip install 'trimesh>=4.6'") from error
    scene = trimesh.Scene()
    paints = surface_colours(estimate, colours)
    for item, paint in zip(estimate.objects, paints, strict=True):
        name = f"object_{item.id:02d}"
        mesh = trimesh.Trimesh(item.mesh.vertices, item.mesh.faces, process=False)
        if np.ndim(paint) == 2:
            mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=_linear(paint))
        else:
            material = trimesh.visual.material.PBRMaterial(
                name=name, baseColorFactor=[*_bytes(paint).tolist(), 255], **_MATT
            )
            mesh.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=_Y_UP)
    with replacing(path) as temporary:
        temporary.write_bytes(
            scene.export(file_type="glb", tree_postprocessor=_add_materials)
            if scene.geometry
            else _EMPTY_GLB
        )


def _add_materials(tree: dict[str, Any]) -> None:
    """Gives meshes with colours of vertices a matt material; without one glTF makes them metal."""
    materials = tree.setdefault("materials", [])
    for mesh in tree.get("meshes", ()):
        for primitive in mesh["primitives"]:
            if "material" not in primitive:
                primitive["material"] = len(materials)
                materials.append({"name": mesh["name"], "pbrMetallicRoughness": dict(_MATT)})


def _linear(paint: Colour | NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours (V, 4) of vertices as glTF has them: linear; images are sRGB (IEC 61966-2-1)."""
    srgb = np.asarray(paint, dtype=np.float64)
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return np.column_stack([_bytes(linear), np.full(len(linear), 255)]).astype(np.uint8)


def _bytes(colour: Colour | NDArray[np.float64]) -> NDArray[np.int64]:
    return np.rint(np.clip(colour, 0, 1) * 255).astype(np.int64)


def _empty_glb() -> bytes:
    """A valid GLB without any object: trimesh refuses to write one."""
    chunk = b'{"asset":{"version":"2.0"},"scene":0,"scenes":[{}]}'
    chunk += b" " * (-len(chunk) % 4)
    header = b"glTF" + np.array([2, 20 + len(chunk)], dtype="<u4").tobytes()
    return header + np.array([len(chunk)], dtype="<u4").tobytes() + b"JSON" + chunk


_EMPTY_GLB = _empty_glb()
