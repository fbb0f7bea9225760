// Animated WebP of still ones (https://developers.google.com/speed/webp/docs/riff_container).

const uint = (value, bytes) => Buffer.from(Array.from({ length: bytes }, (_, k) => (value >> (8 * k)) & 255));

function chunk(name, ...parts) {
  const body = Buffer.concat(parts);
  return Buffer.concat([Buffer.from(name), uint(body.length, 4), body, Buffer.alloc(body.length & 1)]);
}

/** Frames of one size, which are shown for some milliseconds each, again and again. */
export function animate(frames, milliseconds) {
  const images = frames.map((file) => {
    const at = file.indexOf("VP8 ", 12);
    return file.subarray(at, at + 8 + file.readUInt32LE(at + 4));
  });
  const sizes = images.map((image) => [14, 16].map((at) => image.readUInt16LE(at) & 0x3fff));
  const [[width, height]] = sizes;
  if (sizes.some((size) => String(size) !== String(sizes[0]))) {
    throw new Error(`frames of several sizes: ${[...new Set(sizes.map(String))].join("; ")}`);
  }
  const size = Buffer.concat([uint(width - 1, 3), uint(height - 1, 3)]);
  return chunk(
    "RIFF", Buffer.from("WEBP"), chunk("VP8X", uint(2, 4), size), chunk("ANIM", uint(0, 6)),
    ...images.map((image) => chunk("ANMF", uint(0, 6), size, uint(milliseconds, 3), uint(0, 1), image)),
  );
}
