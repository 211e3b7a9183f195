"""CPU time of a training step: PyTorch beside `shakedown train`, same network, same batch, one thread.

    python3 tests/training/pytorch_step.py SHAKEDOWN ACRONYM/seen [paper|best]

The network is that of trainer/presets/{paper,best}.toml as trainer/src/network.rs builds it: forward,
backward, clipped gradient, Adam. Ours is timed from the outside, as the difference of two trainings of
different length, so it includes the making of batches (distances at the hand, pairing, rotation of
grids); PyTorch gets its numbers for nothing. Needs torch.
"""

import resource
import subprocess
import sys
import tempfile
import time

import torch
from torch import nn

PRESETS = {
    # objects, grasps each, features, latent, layers, their width; grid edge or histogram bins
    "paper": (16, 64, 9 + 3 + 1 + 8, 256, 4, 512, 32),
    "best": (32, 16, 2 * 386 + 3 + 1 + 1 + 8 + 80, 24, 5, 560, 16),
}


class Network(nn.Module):
    def __init__(self, name):
        super().__init__()
        self.objects, self.each, features, latent, layers, width, size = PRESETS[name]
        self.size = size
        if name == "paper":
            channels = [1, 16, 32, 64, 128]
            convs = []
            for a, b in zip(channels, channels[1:]):
                convs += [nn.Conv3d(a, b, 3, stride=2, padding=1), nn.SiLU()]
            self.encoder = nn.Sequential(*convs, nn.Flatten())
            inputs = (size // 16) ** 3 * 128
            self.grid = (self.objects, 1, size, size, size)
        else:
            self.encoder = nn.Identity()
            inputs = size
            self.grid = (self.objects, size)
        self.latent = nn.Sequential(nn.Linear(inputs + 1, latent), nn.SiLU())
        self.first = nn.Linear(features + latent, width)
        self.layers = nn.ModuleList(nn.Linear(width, width) for _ in range(layers - 1))
        self.out = nn.Linear(width, 12)
        self.features = features

    def forward(self, grids, scale, features):
        latent = self.latent(torch.cat([self.encoder(grids), scale], 1))
        latent = latent.repeat_interleave(self.each, 0)
        x = nn.functional.silu(self.first(torch.cat([features, latent], 1)))
        for layer in self.layers:
            x = x + nn.functional.silu(layer(x))
        return self.out(x)


def torch_step_s(name, steps=40):
    torch.set_num_threads(1)
    torch.manual_seed(0)
    network = Network(name)
    adam = torch.optim.Adam(network.parameters(), lr=1e-3)
    rows = network.objects * network.each
    grids = torch.randn(network.grid)
    scale = torch.rand(network.objects, 1)
    features = torch.randn(rows, network.features)
    target = torch.randn(rows, 12)

    def step():
        adam.zero_grad()
        ((network(grids, scale, features) - target) ** 2).sum(1).mean().backward()
        nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        adam.step()

    for _ in range(5):
        step()
    start = time.process_time()
    for _ in range(steps):
        step()
    return (time.process_time() - start) / steps


def own_step_s(shakedown, data, name, steps=40):
    taken = []
    for n in (5, 5 + steps):
        with tempfile.TemporaryDirectory() as out:
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            subprocess.run(
                [shakedown, "train", "--data", f"{data}/grasps", "--mesh-root", data, "--preset", name,
                 "--steps", str(n), "--threads", "1", "--out", f"{out}/model", "-q"],
                check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            taken.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
    return (taken[1] - taken[0]) / steps


def main():
    shakedown, data = sys.argv[1:3]
    for name in sys.argv[3:] or PRESETS:
        ratios = []
        for _ in range(3):
            theirs, own = torch_step_s(name), own_step_s(shakedown, data, name)
            ratios.append((own / theirs, own, theirs))
        ratio, own, theirs = sorted(ratios)[1]
        print(f"{name}: a step takes {1e3 * own:.0f} ms, PyTorch {torch.__version__} {1e3 * theirs:.0f} ms: "
              f"{ratio:.2f} times (median of three)")


main()
