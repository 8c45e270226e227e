"""Writes casas_otaduy_reference.json: a few training steps of the autoencoder and of the regressor of Casas and Otaduy
(2018), and free rollouts, in PyTorch float64.

The networks, the losses and their gradients are PyTorch's own. What a step draws (frames, noise, whose latents are fed
back) comes from the same counter as in the program: SplitMix64 over a key, rewritten here.

    python3 casas_otaduy_reference.py        # needs torch and numpy; written with torch 2.15
"""

import json
import math
import pathlib

import numpy as np
import torch

torch.set_default_dtype(torch.float64)
MASK = (1 << 64) - 1

VERTICES, POSES, LATENTS, OUTER, INNER = 4, 4, 3, 7, 6
WIDTH = 3 * VERTICES
HISTORY = 2
HIDDEN = math.isqrt((2 * LATENTS + HISTORY * POSES) * WIDTH)
SEED = 5


def mix(z):
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
    return z ^ (z >> 31)


class Draws:
    def __init__(self, seed, stage, epoch, step):
        key = mix(seed ^ 0x9E3779B97F4A7C15)
        for byte in stage.encode():
            key = mix(key ^ byte)
        key = mix(key ^ epoch)
        self.key = mix(key ^ (((step << 32) | (step >> 32)) & MASK))
        self.counter = 0

    def bits(self):
        self.counter += 1
        return mix(self.key ^ ((self.counter * 0xD1342543DE82EF95) & MASK))

    def uniform(self):
        return (self.bits() >> 11) / (1 << 53)

    def normal(self):
        u, v = 1.0 - self.uniform(), self.uniform()
        return math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * v)

    def below(self, n):
        return (self.bits() * n) >> 64


def rounded(x):
    """A number that f32 holds."""
    return torch.tensor(np.asarray(x, np.float32).astype(np.float64))


def layer(rng, inputs, outputs):
    linear = torch.nn.Linear(inputs, outputs)
    with torch.no_grad():
        linear.weight.copy_(rounded(rng.normal(scale=inputs**-0.5, size=(outputs, inputs))))
        linear.bias.copy_(rounded(rng.normal(scale=0.1, size=outputs)))
    return linear


class ThreeLayers(torch.nn.Module):
    def __init__(self, rng, sizes):
        super().__init__()
        self.first, self.second, self.third = (layer(rng, a, b) for a, b in zip(sizes, sizes[1:]))

    def forward(self, x):
        return self.third(torch.relu(self.second(self.first(x))))


class Autoencoder(torch.nn.Module):
    def __init__(self, rng):
        super().__init__()
        self.encoder = ThreeLayers(rng, [WIDTH, OUTER, INNER, LATENTS])
        self.decoder = ThreeLayers(rng, [LATENTS, INNER, OUTER, WIDTH])

    def forward(self, x):
        return self.decoder(self.encoder(x))


class Regressor(torch.nn.Module):
    def __init__(self, rng):
        super().__init__()
        self.hidden = layer(rng, 2 * LATENTS + HISTORY * POSES, HIDDEN)
        self.output = layer(rng, HIDDEN, WIDTH)

    def forward(self, x):
        return self.output(torch.relu(self.hidden(x)))


def parameters(module):
    """Name and numbers as the program keeps them: weights `[inputs, outputs]`."""
    return {n: (p.T if p.ndim == 2 else p).detach().flatten().tolist() for n, p in module.named_parameters()}


def adam(module):
    return torch.optim.Adam(module.parameters(), lr=1.0, betas=(0.9, 0.999), eps=1e-8)


def set_rate(optimiser, start, step, steps):
    optimiser.param_groups[0]["lr"] = start * 0.5 * (1.0 + math.cos(math.pi * step / steps))


def learn(optimiser, loss):
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()
    return loss.item()


def standard(frames):
    mean, deviation = frames.mean(0), frames.std(0, unbiased=False)
    return mean, torch.maximum(deviation, 0.05 * deviation.square().mean().sqrt())


def main():
    rng = np.random.RandomState(2018)  # the legacy generator's stream is frozen
    clips = []
    for frames in (9, 7):
        poses = rounded(rng.normal(size=(frames, POSES)))
        clips.append((poses, rounded(0.01 * rng.normal(size=(frames, WIDTH)))))
    rigidity = rounded([2.0, 0.5, 1.0, 0.5])
    per_number = rigidity.repeat_interleave(3)
    mean, deviation = standard(torch.cat([d for _, d in clips]))
    pose_mean, pose_deviation = standard(torch.cat([p for p, _ in clips]))
    deltas = [(d - mean) / deviation for _, d in clips]
    poses = [(p - pose_mean) / pose_deviation for p, _ in clips]
    out = {
        "vertices": VERTICES, "poses": POSES, "latents": LATENTS, "widths": [OUTER, INNER], "hidden": HIDDEN,
        "clips": [{"poses": p.flatten().tolist(), "deltas": d.flatten().tolist()} for p, d in clips],
        "rigidity": rigidity.tolist(),
    }

    # The autoencoder, on distances between vertices in mm.
    network, steps, start, batch = Autoencoder(rng), 5, 0.01, 4
    out["autoencoder"] = {"steps": steps, "batch": batch, "learning_rate": start, "start": parameters(network)}
    optimiser, losses, frames = adam(network), [], torch.cat(deltas)
    for step in range(steps):
        draws = Draws(SEED, "autoencoder", 0, step)
        wanted = frames[[draws.below(len(frames)) for _ in range(batch)]]
        error = 1000.0 * deviation * (network(wanted) - wanted)
        set_rate(optimiser, start, step, steps)
        losses.append(learn(optimiser, error.square().sum() / (batch * VERTICES)))
    error = (deviation * (network(frames) - frames)).reshape(-1, VERTICES, 3).norm(dim=2)
    out["autoencoder"] |= {"losses": losses, "end": parameters(network), "validation_mm": 1000.0 * error.mean().item()}

    # The regressor, on its trained encoder.
    for p in network.parameters():
        p.requires_grad_(False)
    codes = [network.encoder(d) for d in deltas]
    latent_mean, latent_deviation = standard(torch.cat(codes))
    codes = [(c - latent_mean) / latent_deviation for c in codes]
    encode = lambda d: (network.encoder(d) - latent_mean) / latent_deviation
    rest = encode(-mean / deviation)
    everything = torch.cat(codes + [rest[None]])
    lower, upper = everything.min(0).values, everything.max(0).values
    regressor = Regressor(rng)
    settings = {"steps": 6, "batch": 5, "learning_rate": 0.01, "latent_noise": 0.3, "pose_noise": 0.2,
                "own_latents": 0.5, "rollout_every": 2}
    out["regressor"] = settings | {"start": parameters(regressor)}

    def history(clip, t):
        return torch.cat([poses[clip][max(t - k, 0)] for k in range(HISTORY)])

    def roll_out(clip):
        z1, z2, deltas, latents = rest, rest, [], []
        for t in range(len(poses[clip])):
            deltas.append(regressor(torch.cat([z1, z2, history(clip, t)])))
            z1, z2 = torch.clamp(encode(deltas[t]), lower, upper), z1
            latents.append(z1)
        return torch.stack(deltas).detach(), torch.stack(latents).detach()

    optimiser, losses, own = adam(regressor), [], None
    for step in range(settings["steps"]):
        if step > 0 and step % settings["rollout_every"] == 0:
            own = [roll_out(clip)[1] for clip in range(len(clips))]
        draws, noise = Draws(SEED, "regressor", 0, step), Draws(SEED, "regressor/noise", 0, step)
        part = settings["own_latents"] * min(2.0 * step / settings["steps"], 1.0)
        inputs, wanted = [], []
        for _ in range(settings["batch"]):
            n = draws.below(sum(len(p) for p in poses))
            clip, t = (0, n) if n < len(poses[0]) else (1, n - len(poses[0]))
            source = own[clip] if draws.uniform() < part and own is not None else codes[clip]
            row = []
            for k in (1, 2):
                code = source[t - k] if t >= k else rest
                row.append(code + torch.tensor([settings["latent_noise"] * noise.normal() for _ in range(LATENTS)]))
            shared = torch.tensor([settings["pose_noise"] * noise.normal() for _ in range(POSES)])
            row.append(history(clip, t) + shared.repeat(HISTORY))
            inputs.append(torch.cat(row))
            wanted.append(deltas[clip][t])
        error = 1000.0 * deviation * (regressor(torch.stack(inputs)) - torch.stack(wanted))
        set_rate(optimiser, settings["learning_rate"], step, settings["steps"])
        losses.append(learn(optimiser, (per_number * error.square()).sum() / (settings["batch"] * VERTICES)))
    rollouts = [roll_out(clip)[0] for clip in range(len(clips))]
    errors = [(deviation * (r - d)).reshape(-1, VERTICES, 3).norm(dim=2) * rigidity for r, d in zip(rollouts, deltas)]
    out["regressor"] |= {
        "losses": losses,
        "end": parameters(regressor),
        "validation_mm": 1000.0 * torch.cat(errors).mean().item(),
        "rollout_m": [(mean + deviation * r).flatten().tolist() for r in rollouts],
    }
    path = pathlib.Path(__file__).with_suffix(".json")
    path.write_text(json.dumps(out, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main()
