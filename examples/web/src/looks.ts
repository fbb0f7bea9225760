/** What the page draws over a material: rigidity, strain, lines of the texture, and rings of the size at rest. */
import {
  BufferGeometry, DataTexture, DoubleSide, Float32BufferAttribute, HalfFloatType, LinearFilter, Mesh,
  OrthographicCamera, RedFormat, RepeatWrapping, Scene, ShaderMaterial, Vector4, WebGLRenderTarget, type Texture,
  type WebGLRenderer,
} from "three";
import type { Part } from "./state.js";

export const LOOKS = ["material", "rigidity", "strain"] as const;
export type Look = (typeof LOOKS)[number];

/** Uniforms that all parts share. Rings are centres and radii, of the mesh's own UVs and then redirected. */
export const shared = {
  look: { value: 0 },
  lines: { value: 0 },
  /** What is rigid over a picture, 0..1. */
  overlay: { value: 0 },
  rings: { value: Array.from({ length: 6 }, () => new Vector4(0, 0, 0, 0)) },
  brush: { value: new Vector4(0, 0, 0, 0) },
};

const DECLARATIONS = /* glsl */ `
  uniform sampler2D rigidityMap, restMetric;
  uniform float look, lines, overlay;
  uniform vec4 rings[6], brush;

  // Largest and smallest change of length: eigenvalues of the metric in the pose relative to that at rest.
  vec2 strainAt(vec2 uv, mat2 J, vec3 px, vec3 py) {
    // Beside charts it has an alpha of 0.
    vec4 filtered = texture2D(restMetric, vec2(uv.x, 1.0 - uv.y));
    vec3 rest = filtered.xyz / max(filtered.w, 1e-3);
    float det = determinant(J);
    if (abs(det) < 1e-14 || rest.x <= 0.0) { return vec2(0.0); }
    mat2 inverse = mat2(J[1][1], -J[0][1], -J[1][0], J[0][0]) / det;
    vec3 a = px * inverse[0][0] + py * inverse[0][1], b = px * inverse[1][0] + py * inverse[1][1];
    // The metric at rest has v upwards.
    vec3 m = vec3(dot(a, a), -dot(a, b), dot(b, b));
    float area = rest.x * rest.z - rest.y * rest.y;
    float middle = 0.5 * (m.x * rest.z - 2.0 * m.y * rest.y + m.z * rest.x) / area;
    float root = sqrt(max(middle * middle - (m.x * m.z - m.y * m.y) / area, 0.0));
    return sqrt(max(vec2(middle + root, middle - root), 0.0)) - 1.0;
  }
  float ringAt(vec4 ring, vec3 at, float width) {
    if (ring.w <= 0.0) { return 0.0; }
    float away = distance((viewMatrix * vec4(ring.xyz, 1.0)).xyz, at) - ring.w;
    return smoothstep(width + 0.7, width - 0.7, abs(away) / max(fwidth(away), 1e-6));
  }
`;

const COLOUR = /* glsl */ `
  vec3 seenAt = -vViewPosition;
  float rigidHere = texture2D(rigidityMap, vrtmUv).r;
  if (look == 0.0) {
    // Stripes, which show on paint of any colour.
    float stripe = 0.45 + 0.4 * smoothstep(0.3, 0.5, abs(fract((gl_FragCoord.x + gl_FragCoord.y) / 9.0) - 0.5));
    diffuseColor.rgb = mix(diffuseColor.rgb, vec3(0.93, 0.05, 0.30), overlay * rigidHere * stripe);
  } else if (look == 1.0) {
    diffuseColor = vec4(mix(vec3(0.30, 0.36, 0.42), vec3(0.93, 0.35, 0.07), rigidHere), 1.0);
  } else if (look == 2.0) {
    vec2 s = strainAt(vrtmUv, vrtmGrad, dFdx(seenAt), dFdy(seenAt));
    float most = abs(s.x) > abs(s.y) ? s.x : s.y;
    vec3 tint = most > 0.0 ? vec3(0.84, 0.05, 0.03) : vec3(0.03, 0.18, 0.84);
    // What is elastic may stretch.
    diffuseColor = vec4(mix(vec3(0.22, 0.25, 0.28), mix(vec3(0.9), tint, smoothstep(0.02, 0.3, abs(most))),
      smoothstep(0.25, 0.75, rigidHere)), 1.0);
  }
  if (lines > 0.0) {
    vec2 at = vrtmUv * 40.0, width = fwidth(at);
    vec2 line = smoothstep(width * 1.3, width * 0.3, abs(fract(at - 0.5) - 0.5));
    float shown = 0.8 * max(line.x, line.y) * smoothstep(0.5, 0.2, max(width.x, width.y));
    diffuseColor.rgb = mix(diffuseColor.rgb, vec3(0.005, 0.02, 0.03), shown);
  }
`;

const RINGS = /* glsl */ `
  float ringed = 0.0;
  bool redirected = gl_FragCoord.x >= vrtmWipe && vrtmStrength > 0.5;
  for (int k = 0; k < 3; k++) { ringed = max(ringed, ringAt(redirected ? rings[k + 3] : rings[k], seenAt, 1.6)); }
  gl_FragColor.rgb = mix(gl_FragColor.rgb, vec3(0.85, 0.02, 0.03), ringed);
  gl_FragColor.rgb = mix(gl_FragColor.rgb, vec3(1.0), ringAt(brush, seenAt, 1.2));
`;

/** Adds looks to the materials of a part. Their code comes before that of the redirection, whose `vrtmUv` it reads. */
export function dress(part: Part, renderer: WebGLRenderer) {
  const rigidity = new DataTexture(part.rigidity, part.size, part.size, RedFormat);
  rigidity.minFilter = rigidity.magFilter = LinearFilter;
  rigidity.wrapS = rigidity.wrapT = RepeatWrapping;
  rigidity.needsUpdate = true;
  const metric = { value: null as Texture | null };
  for (const material of new Set(part.meshes.flatMap(({ material }) => material))) {
    const { onBeforeCompile, customProgramCacheKey } = material;
    material.onBeforeCompile = (shader, renderer) => {
      Object.assign(shader.uniforms, shared, { rigidityMap: { value: rigidity }, restMetric: metric });
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>\n${DECLARATIONS}`)
        .replace("#include <alphatest_fragment>", `${COLOUR}\n#include <alphatest_fragment>`)
        .replace("#include <lights_physical_fragment>", /* glsl */ `
          if (look > 0.0) { roughnessFactor = 0.8; metalnessFactor = 0.0; totalEmissiveRadiance = vec3(0.0); }
          #include <lights_physical_fragment>`)
        .replace("#include <tonemapping_fragment>", `${RINGS}\n#include <tonemapping_fragment>`);
      onBeforeCompile.call(material, shader, renderer);
    };
    material.customProgramCacheKey = () => `looks ${customProgramCacheKey.call(material)}`;
    material.needsUpdate = true;
  }
  let target: WebGLRenderTarget | undefined;
  const redraw = () => {
    target?.dispose();
    target = metricOf(part, renderer);
    metric.value = target.texture;
  };
  redraw();
  const dispose = () => [rigidity, target!].forEach((made) => made.dispose());
  return { rigidity, redraw, dispose };
}

/** The metric of a surface at rest, as E, F and G per texel of the tile: drawn once, in UV, v upwards. */
function metricOf({ source: { mesh } }: Part, renderer: WebGLRenderer): WebGLRenderTarget {
  const size = 512;
  const target = new WebGLRenderTarget(size, size, { type: HalfFloatType, depthBuffer: false });
  target.texture.wrapS = target.texture.wrapT = RepeatWrapping;
  const corners = (values: Float32Array, of: Uint32Array, width: number) =>
    new Float32BufferAttribute([...of].flatMap((n) => [...values.subarray(width * n, width * (n + 1))]), width);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", corners(mesh.positions, mesh.indices, 3));
  geometry.setAttribute("uv", corners(mesh.uvs, mesh.uvIndices, 2));
  const material = new ShaderMaterial({
    vertexShader: "varying vec3 at; void main() { at = position; gl_Position = vec4(2.0 * uv - 1.0, 0.0, 1.0); }",
    fragmentShader: `varying vec3 at;
      void main() {
        vec3 a = dFdx(at) * ${size}.0, b = dFdy(at) * ${size}.0;
        gl_FragColor = vec4(dot(a, a), dot(a, b), dot(b, b), 1.0);
      }`,
    side: DoubleSide,
    depthTest: false,
  });
  const stage = new Scene().add(new Mesh(geometry, material));
  stage.children[0].frustumCulled = false;
  renderer.setRenderTarget(target);
  renderer.clear();
  renderer.render(stage, new OrthographicCamera());
  renderer.setRenderTarget(null);
  geometry.dispose();
  material.dispose();
  return target;
}
