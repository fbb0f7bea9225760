"""BC5 of 8-bit maps: each channel of each block of 4 x 4 texels has two ends, and per texel one of eight values from
the one to the other. The ends here are a block's least and largest number; encoders search for better ones."""

import numpy as np


def bc5(numbers: np.ndarray) -> np.ndarray:
    """Numbers of 8 bits, (height, width, 2), after compression, in f64; height and width are multiples of 4."""
    height, width, _ = numbers.shape
    blocks = numbers.reshape(height // 4, 4, width // 4, 4, 2).astype(float)
    low, high = (of(blocks, axis=(1, 3), keepdims=True) for of in (np.min, np.max))
    step = np.where(high > low, high - low, 1) / 7
    return (low + np.rint((blocks - low) / step) * step).reshape(numbers.shape)
