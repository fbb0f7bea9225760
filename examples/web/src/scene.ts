/** The files of a scene, as `cargo run --example scene -- NAME FOLDER` writes them. */
import type { Mesh } from "vrtm";
import { readObj } from "./obj.js";

export interface Scene {
  mesh: Mesh & { positions: Float32Array; uvs: Float32Array; faceCounts: Uint32Array; uvIndices: Uint32Array };
  /** The rest pose, then the others. */
  poses: Float32Array[];
  /** Rigidity of tile 1001, first row at v = 1. */
  rigidity: Uint8Array;
  size: number;
}

async function read(url: string): Promise<Response> {
  const response = await fetch(url);
  if (!response.ok) {
    throw new Error(`${url}: ${response.status} ${response.statusText}`);
  }
  return response;
}

export async function openScene(folder: string): Promise<Scene> {
  const [text, frames, image] = await Promise.all([
    read(`${folder}/rest.obj`).then((file) => file.text()),
    read(`${folder}/frames.f32`).then((file) => file.arrayBuffer()),
    read(`${folder}/rigidity.1001.png`).then((file) => file.blob()),
  ]);
  const mesh = readObj(text) as Scene["mesh"];
  const all = new Float32Array(frames);
  const count = mesh.positions.length;
  const poses = [mesh.positions];
  for (let first = 0; first < all.length; first += count) {
    poses.push(all.slice(first, first + count));
  }
  const bitmap = await createImageBitmap(image, { colorSpaceConversion: "none" });
  const size = bitmap.width;
  const canvas = new OffscreenCanvas(size, size);
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  context.drawImage(bitmap, 0, 0);
  const texels = context.getImageData(0, 0, size, size).data;
  return { mesh, poses, rigidity: texels.filter((_, k) => k % 4 === 0) as unknown as Uint8Array, size };
}

/** The pose at a time from 0 (rest) to 1 (the last pose). */
export function poseAt({ poses }: Scene, time: number): Float32Array {
  const at = Math.min(time, 1) * (poses.length - 1);
  const k = Math.min(Math.floor(at), poses.length - 2);
  const [from, to, share] = [poses[k], poses[k + 1], at - k];
  return from.map((x, n) => x + (to[n] - x) * share);
}
