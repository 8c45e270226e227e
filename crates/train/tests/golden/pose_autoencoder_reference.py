"""Writes pose_autoencoder_reference.json: the pose autoencoder of SoftSMPL eq. 13, forward and backward, in PyTorch
float64. The gradients are PyTorch's own.

    python3 pose_autoencoder_reference.py        # needs torch and numpy; any version gives the same numbers to 1e-8
"""

import json
import pathlib

import numpy as np
import torch

BATCH, COMPONENTS, ANGLES, LATENTS, WIDTH, HIDDEN = 5, 7, 9, 3, 6, 2


def network(rng, inputs, outputs):
    sizes = [inputs] + [WIDTH] * HIDDEN + [outputs]
    layers = torch.nn.ModuleList(torch.nn.Linear(a, b, dtype=torch.float64) for a, b in zip(sizes, sizes[1:]))
    with torch.no_grad():
        for p in layers.parameters():
            p.copy_(torch.from_numpy(rng.uniform(-0.6, 0.6, p.shape).astype(np.float32).astype(np.float64)))
    return layers


def forward(layers, x):
    for layer in layers[:-1]:
        x = torch.tanh(layer(x))
    return layers[-1](x)


def main():
    rng = np.random.RandomState(20202)  # the legacy generator's stream is frozen
    networks = {
        "mesh_encoder": network(rng, COMPONENTS, LATENTS),
        "pose_encoder": network(rng, ANGLES, LATENTS),
        "decoder": network(rng, LATENTS, COMPONENTS),
    }
    draw = lambda *shape: torch.from_numpy(rng.normal(size=shape).astype(np.float32).astype(np.float64))
    mesh, angles = draw(BATCH, COMPONENTS), 0.5 * draw(BATCH, ANGLES)  # rotations under a half turn
    latents = [forward(networks["mesh_encoder"], mesh), forward(networks["pose_encoder"], angles)]
    outputs = [forward(networks["decoder"], p) for p in latents]
    losses = [((mesh - output) ** 2).sum() for output in outputs]
    sum(losses).backward()

    flat = lambda t: [float(v) for v in t.detach().numpy().ravel()]
    named = lambda of: {
        f"{name}.layers.{i}.{kind}": flat(of(getattr(layer, kind)))
        for name, layers in networks.items()
        for i, layer in enumerate(layers)
        for kind in ("weight", "bias")
    }
    out = {
        "batch": BATCH, "components": COMPONENTS, "angles": ANGLES, "latents": LATENTS, "width": WIDTH, "hidden": HIDDEN,
        "mesh_input": flat(mesh), "angle_input": flat(angles),
        "mesh_latent": flat(latents[0]), "pose_latent": flat(latents[1]),
        "mesh_output": flat(outputs[0]), "pose_output": flat(outputs[1]),
        "mesh_loss": losses[0].item(), "pose_loss": losses[1].item(),
        "parameters": named(lambda p: p), "gradients": named(lambda p: p.grad),
    }
    path = pathlib.Path(__file__).with_suffix(".json")
    path.write_text(json.dumps(out, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main()
