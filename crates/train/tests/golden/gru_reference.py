"""Writes gru_reference.json: one GRU layer in PyTorch's convention, forward and backward, in NumPy float64.

The forward pass is PyTorch's documented formula (torch.nn.GRU, gates in the order r, z, n). The gradients are
central differences of the loss, so they share no derivation with the code under test.

    python3 gru_reference.py        # needs numpy; any version since 1.20 gives the same numbers
"""

import json
import pathlib

import numpy as np

FRAMES, BATCH, INPUTS, WIDTH = 7, 3, 4, 5


def sigmoid(x):
    return 1.0 / (1.0 + np.exp(-x))


def forward(p, x):
    h = np.zeros((BATCH, WIDTH))
    states = []
    for t in range(FRAMES):
        i = x[t] @ p["weight_ih"].T + p["bias_ih"]
        s = h @ p["weight_hh"].T + p["bias_hh"]
        i_r, i_z, i_n = np.split(i, 3, axis=1)
        s_r, s_z, s_n = np.split(s, 3, axis=1)
        r = sigmoid(i_r + s_r)
        z = sigmoid(i_z + s_z)
        n = np.tanh(i_n + r * s_n)
        h = (1.0 - z) * n + z * h
        states.append(h)
    return np.stack(states)


def main():
    rng = np.random.RandomState(20201)  # the legacy generator's stream is frozen
    p = {
        "weight_ih": rng.uniform(-0.7, 0.7, (3 * WIDTH, INPUTS)),
        "weight_hh": rng.uniform(-0.7, 0.7, (3 * WIDTH, WIDTH)),
        "bias_ih": rng.uniform(-0.3, 0.3, 3 * WIDTH),
        "bias_hh": rng.uniform(-0.3, 0.3, 3 * WIDTH),
    }
    p = {k: v.astype(np.float32).astype(np.float64) for k, v in p.items()}
    x = rng.normal(size=(FRAMES, BATCH, INPUTS)).astype(np.float32).astype(np.float64)
    weights = rng.normal(size=(FRAMES, BATCH, WIDTH)).astype(np.float32).astype(np.float64)

    def loss():
        return float((weights * forward(p, x)).sum())

    gradients = {}
    for name, value in p.items():
        gradient = np.zeros_like(value)
        for i in np.ndindex(value.shape):
            kept = value[i]
            value[i] = kept + 1e-5
            above = loss()
            value[i] = kept - 1e-5
            below = loss()
            value[i] = kept
            gradient[i] = (above - below) / 2e-5
        gradients[name] = gradient

    flat = lambda a: [float(v) for v in np.asarray(a).ravel()]
    out = {
        "frames": FRAMES,
        "batch": BATCH,
        "inputs": INPUTS,
        "width": WIDTH,
        "input": flat(x),
        "loss_weights": flat(weights),
        "states": flat(forward(p, x)),
        "parameters": {k: flat(v) for k, v in p.items()},
        "gradients": {k: [round(v, 8) for v in flat(g)] for k, g in gradients.items()},
    }
    path = pathlib.Path(__file__).with_suffix(".json")
    path.write_text(json.dumps(out, indent=None, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main()
