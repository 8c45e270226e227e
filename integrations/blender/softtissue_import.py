"""Brings an animation of `softtissue animate --out NAME.pc2` (or .mdd) into Blender.

As an add-on: Edit > Preferences > Add-ons > Install from disk, then File > Import > softtissue animation.
Without a window: `python softtissue_import.py NAME.pc2 --fps 60 --save NAME.blend` with the package bpy.

The mesh NAME.obj beside the cache becomes an object, the cache its mesh cache modifier, so that modifiers and materials of
one's own can follow it. The file's Y up becomes Blender's Z up by a rotation of the object.
"""

import argparse
import math
import pathlib
import struct
import sys

import bpy

bl_info = {
    "name": "softtissue animation",
    "author": "the softtissue authors",
    "version": (1, 0, 0),
    "blender": (4, 2, 0),
    "location": "File > Import > softtissue animation (.pc2, .mdd)",
    "description": "A body that moves with its soft tissue, as softtissue animate writes it",
    "category": "Import-Export",
}


class BadFile(Exception):
    """A file that cannot be imported; the message says which and why."""


def read_obj(path):
    """Vertices, faces, and texture coordinates a face corner (or none) of an OBJ file of `softtissue animate`."""
    vertices, coordinates, faces, corners = [], [], [], []
    with open(path, encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            words = line.split()
            try:
                if not words or words[0] not in ("v", "vt", "f"):
                    continue
                if words[0] == "v":
                    vertices.append(tuple(map(float, words[1:4])))
                elif words[0] == "vt":
                    coordinates.append(tuple(map(float, words[1:3])))
                else:
                    indices = [word.split("/") for word in words[1:]]
                    faces.append(tuple(int(i[0]) - 1 for i in indices))
                    corners.extend(int(i[1]) - 1 for i in indices if len(i) > 1 and i[1])
            except ValueError as error:
                raise BadFile(f"{path}:{number}: {error}") from error
    if not vertices or not faces:
        raise BadFile(f"{path}: no mesh in it")
    return vertices, faces, [coordinates[i] for i in corners]


def cache_facts(path):
    """Format, frames, points and frames a second (None where the file does not tell) of a point cache."""
    with open(path, "rb") as file:
        head = file.read(32)
        if head.startswith(b"POINTCACHE2\0") and len(head) == 32:
            _, points, _, _, frames = struct.unpack("<iiffi", head[12:])
            return "PC2", frames, points, None
        if path.suffix.lower() != ".mdd" or len(head) < 12:
            raise BadFile(f"{path}: neither a PC2 nor an MDD point cache")
        frames, points = struct.unpack(">ii", head[:8])
        file.seek(8)
        times = file.read(8)
        step = struct.unpack(">ff", times)[1] if frames > 1 and len(times) == 8 else 0.0
        return "MDD", frames, points, 1.0 / step if step > 0.0 else None


def import_animation(context, path, fps=None):
    """An object that moves, in the current collection; the scene takes its frame range, and its rate where it is known."""
    path = pathlib.Path(path)
    kind, frames, points, told = cache_facts(path)
    vertices, faces, uv = read_obj(path.with_suffix(".obj"))
    if len(vertices) != points:
        raise BadFile(f"{path} moves {points} vertices, {path.with_suffix('.obj')} has {len(vertices)}")
    mesh = bpy.data.meshes.new(path.stem)
    mesh.from_pydata(vertices, [], faces)
    if len(uv) == len(mesh.loops):
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", [x for pair in uv for x in pair])
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.update()
    body = bpy.data.objects.new(path.stem, mesh)
    body.rotation_euler = (math.radians(90.0), 0.0, 0.0)
    context.collection.objects.link(body)

    cache = body.modifiers.new("softtissue", "MESH_CACHE")
    cache.cache_format = kind
    cache.filepath = str(path.resolve())
    cache.interpolation = "LINEAR"
    cache.play_mode = "SCENE"
    cache.frame_start = context.scene.frame_start
    context.scene.frame_end = context.scene.frame_start + frames - 1
    rate = fps or told
    if rate:
        context.scene.render.fps = max(1, round(rate))
        context.scene.render.fps_base = context.scene.render.fps / rate
    return body


class ImportSofttissue(bpy.types.Operator):
    """Import a body that moves with its soft tissue (.pc2 or .mdd, with its .obj beside it)"""

    bl_idname = "import_scene.softtissue"
    bl_label = "Import softtissue animation"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default="*.pc2;*.mdd", options={"HIDDEN"})
    fps: bpy.props.FloatProperty(
        name="Frames a second", default=0.0, min=0.0, description="0 takes the file's own, where it tells"
    )

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        try:
            import_animation(context, self.filepath, self.fps or None)
        except (BadFile, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


def menu(self, _context):
    self.layout.operator(ImportSofttissue.bl_idname, text="softtissue animation (.pc2, .mdd)")


def register():
    bpy.utils.register_class(ImportSofttissue)
    bpy.types.TOPBAR_MT_file_import.append(menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(menu)
    bpy.utils.unregister_class(ImportSofttissue)


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cache", help="NAME.pc2 or NAME.mdd")
    parser.add_argument("--fps", type=float, help="frames a second; a .mdd tells its own")
    parser.add_argument("--save", help="Blender file to write")
    given = parser.parse_args(arguments)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    try:
        import_animation(bpy.context, given.cache, given.fps)
    except (BadFile, OSError) as error:
        sys.exit(f"softtissue: {error}")
    if given.save:
        bpy.ops.wm.save_as_mainfile(filepath=str(pathlib.Path(given.save).resolve()))


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
