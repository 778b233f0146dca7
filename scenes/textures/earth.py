"""Draws earth.png: a planet with continents, deserts and ice, in Python with NumPy and Pillow."""

import numpy as np
from PIL import Image

WIDTH, HEIGHT = 1024, 512
random = np.random.default_rng(5)

latitude, longitude = np.meshgrid(
    np.pi * (0.5 - (np.arange(HEIGHT) + 0.5) / HEIGHT), 2 * np.pi * np.arange(WIDTH) / WIDTH, indexing="ij"
)
sphere = np.stack([np.cos(latitude) * np.cos(longitude), np.sin(latitude), np.cos(latitude) * np.sin(longitude)], -1)


def noise(frequency, octaves, gain=0.5):
    """Waves of random directions on the sphere, ever finer: about -1 to 1, without a seam."""
    total, weights = 0, 0
    for octave in range(octaves):
        waves = random.normal(size=(14, 3)) * frequency * 2**octave
        phases = random.uniform(0, 2 * np.pi, 14)
        total = total + gain**octave * np.cos(sphere @ waves.T + phases).sum(-1) / 14**0.5
        weights += gain**octave
    return total / weights


def step(low, high, x):
    t = np.clip((x - low) / (high - low), 0, 1)[..., None]
    return t * t * (3 - 2 * t)


def colour(code):
    return np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)]) / 255


ground = noise(1.7, 7, 0.6)
ground = ground - np.quantile(ground, 0.66) + 0.155  # a third is land
wet = 0.9 * noise(2.6, 6, 0.6) + 0.35 * np.cos(6 * latitude)
polar = np.abs(latitude) / (np.pi / 2) + 0.10 * noise(4, 5, 0.6)
land = step(0.14, 0.17, ground)

sea = colour("0d2f5e") + (colour("2d7596") - colour("0d2f5e")) * step(-0.12, 0.14, ground)
green = colour("a8935f") + (colour("4c6a34") - colour("a8935f")) * step(-0.35, 0.35, wet)
green = green + (colour("6b6a4c") - green) * step(0.45, 0.62, polar)
green = green + (colour("7a6650") - green) * step(0.45, 0.75, ground)
picture = sea + (green - sea) * land
picture = picture + (colour("eef3f6") - picture) * step(0.80, 0.85, polar + 0.05 * land[..., 0])
Image.fromarray((255 * picture).clip(0, 255).astype(np.uint8)).quantize(96).save("earth.png", optimize=True)
