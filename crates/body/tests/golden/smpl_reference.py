"""Writes smpl_reference.safetensors: a small random body, poses, and what SMPL's published formulas make of them.

Formulas: Loper et al., "SMPL: A Skinned Multi-Person Linear Model", 2015, equations 1 (Rodrigues), 2-4 (skinning
with the rest joints taken out), 5-6 and 8 (shape), 9 (pose) and 10 (joints from the shaped mesh). All sums are in
float64 on inputs that float32 holds exactly. Needs NumPy only:

    python smpl_reference.py
"""

import json
import pathlib
import struct

import numpy as np

VERTICES, JOINTS, SHAPES, POSES = 40, 24, 4, 6
PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]


def rodrigues(w):
    """Equation 1: I + sin|w| [w/|w|] + (1 - cos|w|) [w/|w|]^2."""
    angle = np.linalg.norm(w)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = w / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def smpl(body, beta, theta, translation, delta):
    """Posed vertices [V, 3] and posed joints [J, 3]."""
    shaped = body["template"] + np.einsum("s,svc->vc", beta, body["shape_directions"])
    joints = body["joint_regressor"] @ shaped
    rotations = [rodrigues(w) for w in theta]
    features = np.concatenate([(r - np.eye(3)).ravel() for r in rotations[1:]])
    rest = shaped + np.einsum("p,pvc->vc", features, body["pose_directions"]) + delta

    world = []
    for j, parent in enumerate(PARENTS):
        local = np.eye(4)
        local[:3, :3] = rotations[j]
        local[:3, 3] = joints[j] - (joints[parent] if parent >= 0 else 0.0)
        world.append(local if parent < 0 else world[parent] @ local)
    world = np.array(world)
    # G' of equation 3: the rest joints taken out
    relative = world.copy()
    for j in range(JOINTS):
        relative[j, :3, 3] -= world[j, :3, :3] @ joints[j]
    blended = np.einsum("vj,jab->vab", body["skin_weights"], relative)
    posed = np.einsum("vab,vb->va", blended[:, :3, :3], rest) + blended[:, :3, 3] + translation
    return posed, world[:, :3, 3] + translation


def random_body(rng):
    body = {
        "template": rng.uniform(-1.0, 1.0, (VERTICES, 3)),
        "shape_directions": rng.normal(0.0, 0.05, (SHAPES, VERTICES, 3)),
        "pose_directions": rng.normal(0.0, 0.01, (9 * (JOINTS - 1), VERTICES, 3)),
    }
    regressor = np.zeros((JOINTS, VERTICES))
    for row in regressor:
        chosen = rng.choice(VERTICES, 4, replace=False)
        row[chosen] = rng.dirichlet(np.ones(4))
    weights = np.zeros((VERTICES, JOINTS))
    for v, row in enumerate(weights):
        count = 1 + v % 4
        chosen = rng.choice(JOINTS, count, replace=False)
        row[chosen] = rng.dirichlet(np.ones(count))
    body["joint_regressor"], body["skin_weights"] = regressor, weights
    return {name: value.astype(np.float32).astype(np.float64) for name, value in body.items()}


def write_safetensors(path, tensors):
    header, blobs, offset = {"__metadata__": {"kind": "golden"}}, [], 0
    for name, value in sorted(tensors.items()):
        blob = np.ascontiguousarray(value).tobytes()
        dtype = {"float32": "F32", "float64": "F64"}[value.dtype.name]
        header[name] = {"dtype": dtype, "shape": list(value.shape), "data_offsets": [offset, offset + len(blob)]}
        blobs.append(blob)
        offset += len(blob)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + b"".join(blobs))


def main():
    rng = np.random.default_rng(20260101)
    body = random_body(rng)
    exact = lambda x: x.astype(np.float32).astype(np.float64)
    betas = exact(rng.normal(0.0, 1.0, (POSES, SHAPES)))
    thetas = exact(rng.normal(0.0, 0.5, (POSES, JOINTS, 3)))
    thetas[0] = 0.0  # rest
    thetas[1] *= 1e-3  # the series near zero
    thetas[2, 0] = [0.0, 3.0, 0.0]  # turned round
    translations = exact(rng.normal(0.0, 1.0, (POSES, 3)))
    deltas = exact(rng.normal(0.0, 0.01, (POSES, VERTICES, 3)))
    thetas = exact(thetas)
    results = [smpl(body, *case) for case in zip(betas, thetas, translations, deltas)]
    single = {**body, "beta": betas, "theta": thetas, "translation": translations, "delta": deltas}
    tensors = {name: value.astype(np.float32) for name, value in single.items()}
    tensors["posed"] = np.array([posed for posed, _ in results])
    tensors["posed_joints"] = np.array([joints for _, joints in results])
    write_safetensors(pathlib.Path(__file__).with_name("smpl_reference.safetensors"), tensors)


if __name__ == "__main__":
    main()
