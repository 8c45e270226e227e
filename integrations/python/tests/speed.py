"""Times a player's frame on one core, beside ONNX Runtime on the same network and a plain read of the same weights.

usage: python speed.py BUNDLE NETWORK.onnx      (needs softtissue, numpy, onnxruntime; NETWORK of check.py's SHAPE)

The three take turns, so that whatever else the machine does slows them alike. Printed are the median and the fastest tenth.
"""

import sys
import time

import numpy as np
import onnxruntime
import softtissue

from check import SHAPE, motion

ROUNDS = 3


def main(folder, network):
    bundle = softtissue.Bundle(folder)
    player = softtissue.Player(bundle, SHAPE)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(network, options)
    inputs = {i.name: np.zeros([1] + i.shape[1:], np.float32) for i in session.get_inputs()}
    names = [o.name for o in session.get_outputs()]
    weights = np.ones(player.weight_bytes // 8, np.uint64)  # as many bytes as a frame cannot do without

    times = {}

    def note(name, milliseconds):
        times.setdefault(name, []).append(milliseconds)

    for _ in range(ROUNDS):
        for pose, root in zip(*motion(len(bundle.joints))):
            for part, took in player.timed_step(pose, root).items():
                note(part, took)
            feed = {**inputs, "features": player.features[None]}
            begun = time.perf_counter()
            out = session.run(None, feed)
            note("ONNX Runtime", 1e3 * (time.perf_counter() - begun))
            inputs.update({n[: -len("_out")]: v for n, v in zip(names, out) if n.endswith("_out")})
            begun = time.perf_counter()
            weights.sum()
            note("reading the weights once", 1e3 * (time.perf_counter() - begun))
    note_of = lambda parts: np.sum([times[p] for p in parts], axis=0)  # noqa: E731
    times["network (regressor and decoder)"] = note_of(["regressor", "decoder"])
    print(f"{bundle}, {weights.nbytes / 1e6:.1f} MB of weights; milliseconds a frame on one core, {ROUNDS * 600} frames")
    print(f"{'':32} {'median':>8} {'fastest tenth':>14}")
    for name, all_times in times.items():
        print(f"{name:32} {np.median(all_times):8.3f} {np.quantile(all_times, 0.1):14.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
