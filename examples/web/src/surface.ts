/** The mesh as three.js draws it: a corner per pair of vertex and UV, with normals of the mesh's own vertices. */
import { BufferAttribute, BufferGeometry } from "three";
import type { Scene } from "./scene.js";

export class Surface {
  readonly geometry = new BufferGeometry();
  #vertexOf: Uint32Array;
  /** The mesh's own vertices, for their normals. */
  #own = new BufferGeometry();

  constructor({ mesh }: Scene) {
    const corners = new Map<number, number>();
    const [vertices, uvs, index, triangles]: number[][] = [[], [], [], []];
    const corner = (k: number) => {
      const [vertex, uv] = [mesh.indices[k], mesh.uvIndices[k]];
      const key = vertex * (mesh.uvs.length / 2) + uv;
      let place = corners.get(key);
      if (place === undefined) {
        place = corners.size;
        corners.set(key, place);
        vertices.push(vertex);
        uvs.push(mesh.uvs[2 * uv], mesh.uvs[2 * uv + 1]);
      }
      return place;
    };
    let first = 0;
    for (const count of mesh.faceCounts) {
      for (let k = 2; k < count; k++) {
        const fan = [first, first + k - 1, first + k];
        index.push(...fan.map(corner));
        triangles.push(...fan.map((k) => mesh.indices[k]));
      }
      first += count;
    }
    this.#vertexOf = Uint32Array.from(vertices);
    this.#own.setIndex(triangles);
    this.#own.setAttribute("position", new BufferAttribute(mesh.positions.slice(), 3));
    this.geometry.setIndex(index);
    const floats = (size: number) => new BufferAttribute(new Float32Array(vertices.length * size), size);
    this.geometry.setAttribute("position", floats(3));
    this.geometry.setAttribute("normal", floats(3));
    this.geometry.setAttribute("rest", floats(3));
    this.geometry.setAttribute("uv", new BufferAttribute(Float32Array.from(uvs), 2));
    this.#spread(mesh.positions, "rest");
    this.pose(mesh.positions);
  }

  pose(positions: Float32Array): void {
    this.#spread(positions, "position");
    (this.#own.getAttribute("position") as BufferAttribute).copyArray(positions);
    this.#own.computeVertexNormals();
    this.#spread(this.#own.getAttribute("normal").array as Float32Array, "normal");
    this.geometry.computeBoundingSphere();
  }

  #spread(values: Float32Array, name: string): void {
    const attribute = this.geometry.getAttribute(name) as BufferAttribute;
    const to = attribute.array as Float32Array;
    this.#vertexOf.forEach((vertex, corner) => {
      to[3 * corner] = values[3 * vertex];
      to[3 * corner + 1] = values[3 * vertex + 1];
      to[3 * corner + 2] = values[3 * vertex + 2];
    });
    attribute.needsUpdate = true;
  }
}
