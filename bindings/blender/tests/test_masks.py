"""Rigidity out of pictures: against plain loops, and on pictures of which it is known what is in them."""

import numpy as np

from support import Case, part, studs


def overlap(one, other):
    """The area of both over the area of either."""
    one, other = one > 0.5, other > 0.5
    return (one & other).sum() / (one | other).sum()


class Masks(Case):
    def setUp(self):
        super().setUp()
        self.masks = part("masks")
        self.random = np.random.default_rng(1)

    def test_the_threshold_is_the_best_one(self):
        values = np.concatenate([self.random.normal(0.2, 0.05, 4000), self.random.normal(0.7, 0.1, 1000)])
        found = self.masks.otsu(values.astype(np.float32))

        def within(threshold):
            parts = values[values <= threshold], values[values > threshold]
            return sum(len(p) * p.var() for p in parts if len(p))

        best = min(within(t) for t in np.linspace(values.min(), values.max(), 1000))
        self.assertLess(within(found), 1.01 * best)
        self.assertEqual(self.masks.otsu(np.full(5, 0.5, np.float32)), 0.5)
        # Between two values, and not at one of them.
        self.assertAlmostEqual(self.masks.otsu(np.array([0, 0, 1, 1], np.float32)), 0.5, delta=0.01)

    def test_growing_is_the_maximum_over_an_octagon(self):
        values = (self.random.random((40, 50)) > 0.97).astype(np.float32)
        for steps in (1, 2, 5):
            grown = self.masks.grown(values, steps)
            squares, crosses = steps // 2, steps - steps // 2
            for y in range(40):
                for x in range(50):
                    rows, columns = np.mgrid[0:40, 0:50]
                    dy, dx = np.abs(rows - y), np.abs(columns - x)
                    # A square's steps go along both axes at once.
                    rest = np.maximum(dy - squares, 0) + np.maximum(dx - squares, 0)
                    self.assertEqual(grown[y, x], values[rest <= crosses].max(), (steps, y, x))
        self.assertSame(self.masks.shrunk(values, 2), 1 - self.masks.grown(1 - values, 2))
        self.assertSame(self.masks.grown(values, 0), values)

    def test_blurring_keeps_means_and_ramps(self):
        values = self.random.random((64, 48)).astype(np.float32)
        blurred = self.masks.blurred(values, 3)
        expected = values.astype(float)
        for _ in range(3):
            padded = np.pad(expected, 3, "edge")
            expected = np.array([[padded[y : y + 7, x : x + 7].mean() for x in range(48)] for y in range(64)])
        self.assertLess(np.abs(blurred - expected).max(), 1e-5)

    def test_smaller_pictures_are_means(self):
        values = self.random.random((64, 32, 4)).astype(np.float32)
        small = self.masks.smaller(values, 16)
        self.assertEqual(small.shape, (16, 8, 4))
        self.assertLess(np.abs(small[3, 2] - values[12:16, 8:12].mean((0, 1))).max(), 1e-6)
        self.assertSame(self.masks.smaller(values, 64), values)
        self.assertEqual(self.masks.smaller(values, 40).shape, (32, 16, 4))

    def test_colours(self):
        pixels = np.zeros((32, 32, 4), np.float32)
        pixels[8:20, 8:20] = (0.8, 0.1, 0.1, 1)
        found = self.masks.coloured(pixels, (0.75, 0.15, 0.1), 0.1)
        self.assertEqual((found[14, 14], found[2, 2]), (1, 0))
        self.assertEqual(self.masks.coloured(pixels, (0.1, 0.8, 0.1), 0.1).max(), 0)

    def test_what_stands_out_is_found_on_a_slope(self):
        size = 256
        discs, (rows, columns) = studs(size), np.mgrid[0:size, 0:size] / size
        ground = 0.5 + 0.3 * np.sin(3 * columns) + 0.2 * rows
        grain = self.random.normal(0, 0.004, (size, size))
        heights = (ground + 0.06 * discs + grain).astype(np.float32)
        # A threshold on heights alone would not do.
        self.assertLess(overlap(heights > self.masks.otsu(heights), discs), 0.4)
        radius = round(0.11 * size / 2)
        self.assertGreater(overlap(self.masks.raised(heights, radius, 0), discs), 0.85)
        self.assertGreater(overlap(self.masks.raised(heights, radius, 0.3), discs), 0.85)
        self.assertGreater(overlap(self.masks.raised(1 - -heights, radius, 0), discs), 0.85)
        self.assertEqual(self.masks.raised(np.full((32, 32), 0.3, np.float32), 4, 0).max(), 0)
