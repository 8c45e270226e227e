"""Holds the wheel against the player's own self-check, and exported networks in ONNX Runtime against the player.

usage: python check.py BUNDLE [NETWORK.onnx...]      (needs softtissue, numpy; for networks onnx, onnxruntime)

The networks are those of a body of shape SHAPE.
"""

import json
import pathlib
import struct
import sys

import numpy as np
import softtissue

SHAPE = [0.3, -2.0]
FRAMES = 600


def tensors(path):
    """Arrays of a safetensors file, read without its library."""
    data = path.read_bytes()
    (size,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + size])
    kinds = {"F32": np.float32, "U32": np.uint32}
    return {
        name: np.frombuffer(data[8 + size :][slice(*entry["data_offsets"])], kinds[entry["dtype"]]).reshape(entry["shape"])
        for name, entry in header.items()
        if name != "__metadata__" and entry["dtype"] in kinds
    }


def motion(joints):
    """Somebody who swings everything for ten seconds: rotations [T, J, 3] and translations [T, 3]."""
    draws = np.random.default_rng(7)
    t = np.arange(FRAMES)[:, None, None] / 60
    speed, phase, size = (draws.random((1, joints, 3)) for _ in range(3))
    rotations = 0.3 * size * np.sin(2 * np.pi * (0.5 + 2 * speed) * t + 6 * phase)
    t = t[:, 0]
    translations = np.concatenate([0.1 * np.sin(3 * t), 1 + 0.1 * np.abs(np.sin(8 * t)), 0.2 * t], axis=1)
    return rotations.astype(np.float32), translations.astype(np.float32)


def check_player(folder):
    bundle = softtissue.Bundle(folder)
    stored = tensors(pathlib.Path(folder) / "model.safetensors")
    player = softtissue.Player(bundle, stored["check.beta"].tolist())
    deltas = player.rollout(stored["check.rotations"], stored["check.translations"])
    kept = deltas[:, stored["check.vertices"]]
    worst = np.abs(kept - stored["check.deltas"]).max()
    assert np.abs(kept).max() > 1e-4 and worst < 1e-5, worst

    # step by step is the same as at once, and the vertices are the body with the deltas
    player.reset()
    for t, (pose, root) in enumerate(zip(stored["check.rotations"], stored["check.translations"])):
        vertices = player.step(pose, root)
        if player.delay_frames == 0:
            assert np.array_equal(player.deltas, deltas[t])
    assert vertices.shape == (bundle.vertex_count, 3) and vertices.dtype == np.float32
    still = softtissue.Player(bundle)
    at_rest = still.step(np.zeros((len(bundle.joints), 3), np.float32), np.zeros(3, np.float32))
    assert np.abs(at_rest - still.deltas - bundle.rest_mesh()).max() < 1e-5
    assert bundle.faces.shape[1] == 3 and bundle.faces.max() == bundle.vertex_count - 1

    # an animator's control, any time step, and whatever comes in
    still.control(gain=0.0)
    rotations, translations = motion(len(bundle.joints))
    assert not still.rollout(rotations[:30], translations[:30]).any()
    still.control("belly", gain=2.0, softness=1.5)
    still.control(gain=1.0)
    for t in range(0, 40, 2):
        still.step(rotations[t], translations[t], dt=2 / 60)
    assert np.abs(still.deltas).max() > 1e-5
    if bundle.method != "casas-otaduy":
        still.detail(components=1, still=["feet"])
        still.step(rotations[0], translations[0])
        still.detail()
        still.step(rotations[1], translations[1])
    still.step(np.full_like(rotations[0], np.nan), translations[0])
    assert "pose held" in still.report and np.isfinite(still.deltas).all()
    # trust, fading, and a start in the steady state
    assert still.latency == still.delay_frames / bundle.fps
    still.fade(below=0.5, patience=0.0, seconds=0.05)
    draws = np.random.default_rng(3)
    for t in range(30):
        still.step(draws.uniform(-2, 2, rotations[0].shape).astype(np.float32), translations[0])
    assert still.trust < 0.5 and not still.deltas.any()
    still.pre_roll(rotations[0], translations[0], seconds=1)
    assert np.abs(still.deltas).max() > 1e-6
    for wrong, says in [
        (lambda: still.fade(below=2.0), "trust"),
        (lambda: softtissue.Bundle("/nowhere"), "/nowhere"),
        (lambda: softtissue.Player(bundle, [float("nan")]), "shape coefficient 0"),
        (lambda: still.control("nose"), "nose"),
        (lambda: still.control(gain=1e9), "gain"),
        (lambda: still.detail(components=1000000), "components"),
        (lambda: still.detail(still=["nose"]), "nose"),
        (lambda: still.step(np.zeros((24, 2), np.float32), np.zeros(3, np.float32)), "last extent must be 3"),
    ]:
        try:
            wrong()
        except ValueError as refused:
            assert says in str(refused), refused
        else:
            raise AssertionError(f"{says} was not refused")
    print(f"{bundle}: the wheel plays its self-check, at most {worst * 1e6:.2f} micrometres off")


def check_snippet(folder):
    page = pathlib.Path(__file__).parents[3] / "docs" / "play.md"
    snippet = page.read_text().split("```python\n")[1].split("```")[0]
    assert snippet.count("runs/quick/bundle") == 1
    names = {}
    exec(snippet.replace("runs/quick/bundle", str(folder)), names)
    assert np.abs(names["deltas"]).max() > 0 and np.isfinite(names["vertices"]).all()
    print("the snippet of docs/play.md runs")


def check_network(folder, path):
    import onnx
    import onnxruntime

    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    bundle = softtissue.Bundle(folder)
    player = softtissue.Player(bundle, SHAPE)
    session = onnxruntime.InferenceSession(path)
    inputs = [i for i in session.get_inputs() if i.name != "features"]
    state = {i.name: np.zeros([1] + i.shape[1:], np.float32) for i in inputs}
    names = [o.name for o in session.get_outputs()]
    worst = largest = 0.0
    for pose, root in zip(*motion(len(bundle.joints))):
        player.step(pose, root)
        out = dict(zip(names, session.run(None, {"features": player.features[None], **state})))
        state = {name: out[f"{name}_out"] for name in state}
        worst = max(worst, float(np.abs(out["deltas"][0] - player.deltas).max()))
        largest = max(largest, float(np.abs(player.deltas).max()))
    assert largest > 1e-3, f"the flesh hardly moves: {largest} m"
    assert worst < 1e-4 * largest, f"{path}: {worst} m from the player, whose deltas reach {largest} m"

    # two bodies side by side are two bodies
    def run(features, state):
        return dict(zip(names, session.run(None, {"features": features, **state})))

    features = player.features[None]
    other = {name: value * 0.5 for name, value in state.items()}
    both = run(np.concatenate([features, features * 0.5]), {n: np.concatenate([state[n], other[n]]) for n in state})
    alone = [run(features, state), run(features * 0.5, other)]
    assert all(np.abs(both["deltas"][i] - alone[i]["deltas"][0]).max() < 1e-6 for i in range(2))
    assert np.abs(both["deltas"][1] - both["deltas"][0]).max() > 1e-5
    operators = ", ".join(sorted({node.op_type for node in model.graph.node}))
    print(f"{path}: {worst * 1e6:.2f} micrometres from the player over {FRAMES} frames in ONNX Runtime "
          f"{onnxruntime.__version__}, deltas up to {largest * 1e3:.1f} mm ({operators})")
    return {node.op_type for node in model.graph.node}


if __name__ == "__main__":
    check_player(sys.argv[1])
    check_snippet(sys.argv[1])
    for network in sys.argv[2:]:
        operators = check_network(sys.argv[1], network)
        assert "GRU" not in operators or "plain" not in network, f"{network} has {operators}"
