/** A character that is open: what the modules of the page share. */
import type { AnimationMixer, Mesh, Object3D } from "three";
import type { Redirected, Source } from "vrtm/three";

/** Meshes that share a set of textures, and with it one map of what is rigid. */
export interface Part {
  meshes: Mesh[];
  source: Source;
  redirected: Redirected;
  /** Texels of what is rigid, 0 to 255, `size` in a row; the first row is v = 1. */
  rigidity: Uint8Array;
  size: number;
  /** Base colour, for pipette, brightness and detail; the first row is v = 1, null = none. */
  texture: ImageData | null;
}

export interface Open {
  name: string;
  root: Object3D;
  /** Motion that plays, in seconds; a character without one stands still. */
  clip?: { mixer: AnimationMixer; duration: number; name: string };
  parts: Part[];
}
