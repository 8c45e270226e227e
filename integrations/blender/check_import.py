"""Holds what Blender shows of an imported point cache against the same animation as OBJ files.

usage: python check_import.py NAME.pc2|NAME.mdd OBJ_FOLDER       (needs the package bpy)
"""

import pathlib
import sys

import bpy

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import softtissue_import  # noqa: E402


def main(cache, folder):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    softtissue_import.register()
    assert bpy.ops.import_scene.softtissue(filepath=cache) == {"FINISHED"}
    (body,) = bpy.context.collection.objects
    files = sorted(pathlib.Path(folder).glob("frame_*.obj"))
    scene = bpy.context.scene
    assert scene.frame_end - scene.frame_start + 1 == len(files), (scene.frame_start, scene.frame_end, len(files))
    moved = worst = 0.0
    first = softtissue_import.read_obj(files[0])[0]
    for frame, file in enumerate(files):
        scene.frame_set(scene.frame_start + frame)
        evaluated = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
        for shown, expected, start in zip(evaluated.data.vertices, softtissue_import.read_obj(file)[0], first, strict=True):
            place = evaluated.matrix_world @ shown.co
            # Y up in the file, Z up in Blender
            x, y, z = expected
            worst = max(worst, max(abs(place.x - x), abs(place.y + z), abs(place.z - y)))
            moved = max(moved, abs(y - start[1]))
    assert moved > 0.05, f"the animation hardly moves: {moved} m"
    assert worst < 1e-5, f"Blender shows a vertex {worst} m from where it should be"
    broken = pathlib.Path(cache).with_name("broken.pc2")
    broken.write_bytes(b"POINTCACHE")
    try:
        bpy.ops.import_scene.softtissue(filepath=str(broken))
        raise AssertionError("a broken cache came in")
    except RuntimeError as refused:
        assert "broken.pc2" in str(refused), refused
    finally:
        broken.unlink()
    print(f"{cache}: {len(files)} frames in Blender {bpy.app.version_string}, at most {worst * 1e6:.2f} micrometres off")


if __name__ == "__main__":
    main(*sys.argv[1:])
