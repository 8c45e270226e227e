"""Writes dyna_reference.json: Dyna's weighted risk and mixture (Pons-Moll et al. 2015, eqs. 20-25) in NumPy float64.

Every coefficient of every person is one stacked least-squares problem over features, two lags and a constant, with the
rows of person i multiplied by w_i / sqrt(|D_i|) (eq. 24) and ridge rows for the features alone. Nothing is eliminated
or summed beforehand, so the derivation is not the one under test. The body is a box, whose weight and height are
closed forms.

    python3 dyna_reference.py        # needs numpy; any version since 1.20 gives the same numbers
"""

import json
import pathlib

import numpy as np

FEATURES, COEFFICIENTS, STRENGTH, TAU, DENSITY, REACH = 3, 2, 1e-3, 2.0, 1010.0, 2.0
WIDTH, DEPTH, HEIGHT = 0.22, 0.2, 1.7  # metres; beta[0] adds 0.05 to the height, beta[1] takes 0.02 off the width
BETAS = [[0.3, 1.2], [-0.5, -0.1], [0.8, -1.6]]
FRAMES = [70, 50, 90]


def measures(beta):
    height = HEIGHT + 0.05 * beta[0]
    weight = (WIDTH - 0.02 * beta[1]) * DEPTH * height * DENSITY
    return np.array([np.cbrt(weight), height])


def build():
    """[2, 3]: least squares over the mean body and bodies REACH to either side of it."""
    betas = np.array([[0, 0], [REACH, 0], [-REACH, 0], [0, REACH], [0, -REACH]], float)
    design = np.hstack([np.ones((5, 1)), betas])
    return np.linalg.lstsq(design, np.array([measures(b) for b in betas]), rcond=None)[0].T


def bmi(beta):
    root, height = build() @ np.array([1.0, *beta])
    return root**3 / height**2


def simulate(rng, frames, person):
    x = rng.normal(size=(frames, FEATURES))
    lags = np.array([[1.5, -0.75], [0.8, -0.4]]) - 0.1 * person
    drive = rng.uniform(-0.5, 0.5, (COEFFICIENTS, FEATURES))
    c = np.zeros((frames, COEFFICIENTS))
    for t in range(frames):
        one, two = (c[t - 1] if t > 0 else 0.0), (c[t - 2] if t > 1 else 0.0)
        c[t] = lags[:, 0] * one + lags[:, 1] * two + drive @ x[t] + 0.1 + 0.2 * rng.normal(size=COEFFICIENTS)
    return x, c


def fit(people, own, order):
    count = len(people)
    rows, targets, weights = [], [], []
    for i, (x, c) in enumerate(people):
        w = np.sqrt(2.0 * (count - 1)) if i == own else 1.0
        n = len(x) - 2
        rows.append(x[2:])
        targets.append((c[2:], c[1:-1], c[:-2]))
        weights.append(np.full(n, w / np.sqrt(n)))
    x, w = np.vstack(rows), np.concatenate(weights)
    now, one, two = (np.vstack([t[k] for t in targets]) for k in range(3))
    mean = (w[:, None] ** 2 * x).sum(0) / (w**2).sum()
    trace = (w[:, None] ** 2 * (x - mean) ** 2).sum()
    lags, weight, bias = [], [], []
    for k in range(COEFFICIENTS):
        history = np.stack([one[:, k], two[:, k]], 1) if order == 2 else np.zeros((len(x), 0))
        design = np.hstack([x, history, np.ones((len(x), 1))])
        ridge = np.zeros((FEATURES, design.shape[1]))
        ridge[:, :FEATURES] = np.sqrt(STRENGTH * trace) * np.eye(FEATURES)
        left = np.vstack([design * w[:, None], ridge])
        right = np.concatenate([now[:, k] * w, np.zeros(FEATURES)])
        solution = np.linalg.lstsq(left, right, rcond=None)[0]
        weight.append(solution[:FEATURES])
        lags.append(solution[FEATURES:-1] if order == 2 else np.zeros(2))
        bias.append(solution[-1])
    poles = [np.abs(np.roots([1.0, -a, -b])).max() for a, b in lags]
    assert max(poles) < 0.99, "a reference without clamped poles"
    return np.array(lags), np.array(weight), np.array(bias)


def rollout(models, weights, x):
    one = two = np.zeros(COEFFICIENTS)
    out = []
    for frame in x:
        # Eq. 21 as it stands: everybody predicts from the mixture's own history, then the predictions are mixed.
        each = [a[:, 0] * one + a[:, 1] * two + w @ frame + b for a, w, b in models]
        one, two = sum(m * c for m, c in zip(weights, each)), one
        out.append(one)
    return np.array(out)


def main():
    rng = np.random.RandomState(2015)  # the legacy generator's stream is frozen
    raw = [simulate(rng, frames, i) for i, frames in enumerate(FRAMES)]
    rms = np.sqrt(np.mean(np.concatenate([x for x, _ in raw]) ** 2))
    people = [(x / rms, c) for x, c in raw]
    new_beta, new_x = [0.1, -0.9], np.clip(rng.normal(size=(20, FEATURES)), -1.0, 1.0)
    kernel = np.exp(-np.abs(np.array([bmi(b) for b in BETAS]) - bmi(new_beta)) / TAU)
    weights = kernel / kernel.sum()
    out = {
        "strength": STRENGTH,
        "tau": TAU,
        "people": [
            {"beta": b, "bmi": bmi(b), "features": x.ravel().tolist(), "coefficients": c.ravel().tolist()}
            for b, (x, c) in zip(BETAS, raw)
        ],
        "new": {"beta": new_beta, "bmi": bmi(new_beta), "features": new_x.ravel().tolist(), "weights": weights.tolist()},
    }
    for order in (0, 2):
        models = [fit(people, i, order) for i in range(len(people))]
        out[f"order_{order}"] = {
            "people": [
                {"lags": a.ravel().tolist(), "weight": w.ravel().tolist(), "bias": b.tolist()} for a, w, b in models
            ],
            "rollout": rollout(models, weights, new_x / rms).ravel().tolist(),
        }
    path = pathlib.Path(__file__).with_name("dyna_reference.json")
    path.write_text(json.dumps(out, indent=1) + "\n")


if __name__ == "__main__":
    main()
