/** What this page needs of a browser, and a sentence for what is not there. */

/** A function that makes a vector of 128 bits. */
const SIMD = [
  0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11,
];

export function missing(): string | null {
  if (typeof WebAssembly !== "object" || !WebAssembly.validate(Uint8Array.from(SIMD))) {
    return "This page needs WebAssembly with SIMD, as Chrome 91, Firefox 89, Safari 16.4 and later have it.";
  }
  if (!document.createElement("canvas").getContext("webgl2")) {
    return "This page needs WebGL 2, which this browser lacks, or has switched off with hardware acceleration.";
  }
  return null;
}
