// Reads an OBJ file with polygons, their vertices and UVs: what the built-in scenes consist of.

export function readObj(text) {
  const [positions, uvs, faceCounts, indices, uvIndices] = [[], [], [], [], []];
  for (const line of text.split("\n")) {
    const [key, ...words] = line.trim().split(/\s+/);
    if (key === "v") {
      positions.push(...words.map(Number));
    } else if (key === "vt") {
      uvs.push(...words.map(Number));
    } else if (key === "f") {
      faceCounts.push(words.length);
      for (const corner of words) {
        const [vertex, uv] = corner.split("/").map(Number);
        indices.push(vertex - 1);
        uvIndices.push(uv - 1);
      }
    }
  }
  return {
    positions: Float32Array.from(positions),
    uvs: Float32Array.from(uvs),
    faceCounts: Uint32Array.from(faceCounts),
    indices: Uint32Array.from(indices),
    uvIndices: Uint32Array.from(uvIndices),
  };
}
