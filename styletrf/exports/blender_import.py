"""Brings the scene beside this file into Blender: meshes, photographs' cameras, the fly-through.

blender --python import_scene.py
or, in Blender: Scripting, Open, Run.
"""

import json
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix

HERE = Path(__file__).resolve().parent


def main() -> None:
    """Import everything; the fly-through's camera is the scene's."""
    values = json.loads((HERE / "cameras.json").read_text())
    for mesh in sorted(HERE.glob("*.glb")):
        bpy.ops.import_scene.gltf(filepath=str(mesh))
        for imported in bpy.context.selected_objects:
            imported.name = mesh.stem
    for camera in values["photographs"]:
        added(camera)
    fly_through(values["path"], values["frames_per_second"])


def added(camera: dict[str, Any]) -> Any:
    """Returns a new camera."""
    lens = bpy.data.cameras.new(camera["name"])
    lens.sensor_fit = "AUTO"
    lens.sensor_width, lens.lens = camera["sensor_mm"], camera["lens_mm"]
    lens.shift_x, lens.shift_y = camera["shift_x"], camera["shift_y"]
    placed = bpy.data.objects.new(camera["name"], lens)
    bpy.context.collection.objects.link(placed)
    set_pose(placed, camera)
    return placed


def set_pose(placed: Any, camera: dict[str, Any]) -> None:
    """Place an object as the camera was."""
    placed.matrix_world = Matrix(camera["matrix_world"])


def fly_through(path: list[dict[str, Any]], frames_per_second: float) -> None:
    """Add a camera with a key for each frame, and set the scene's size and rate by it."""
    scene, first = bpy.context.scene, path[0]
    scene.render.resolution_x, scene.render.resolution_y = first["width"], first["height"]
    scene.render.pixel_aspect_y = first["pixel_aspect_y"]
    scene.render.fps = max(1, round(frames_per_second))
    scene.frame_start, scene.frame_end = 1, len(path)
    placed = added({**first, "name": "fly-through"})
    placed.rotation_mode = "QUATERNION"
    for number, camera in enumerate(path, start=1):
        set_pose(placed, camera)
        placed.keyframe_insert("location", frame=number)
        placed.keyframe_insert("rotation_quaternion", frame=number)
    scene.camera = placed


main()
