/**
 * Paint that is looked up through the redirection: one look-up of the map more than any other material has. What is rigid is
 * a gilded relief on enamel, with fine lines of equal u and v under it, which show how the skin stretches.
 */
import {
  DataTexture, DoubleSide, HalfFloatType, LinearFilter, LinearMipmapLinearFilter, Mesh, MeshPhysicalMaterial,
  OrthographicCamera, RGFormat, RedFormat, Scene as Stage, ShaderMaterial, UnsignedByteType, Vector2, WebGLRenderTarget,
  type BufferGeometry, type WebGLRenderer,
} from "three";

/** What is drawn. */
export const LOOKS = { paint: 0, rigidity: 1, strain: 2 } as const;
export type Look = keyof typeof LOOKS;

/** Texels of the redirection along each side. */
export const MAP = 512;

const DECLARATIONS = /* glsl */ `
  uniform sampler2D rigidity, redirection, restMetric;
  uniform float redirects, look;
  uniform vec3 ground, relief;
  uniform vec2 brush;
  uniform float brushRadius;
  varying vec2 ownUv;
  varying vec3 ownPosition;

  float rigid(vec2 uv) { return smoothstep(0.25, 0.75, texture2D(rigidity, vec2(uv.x, 1.0 - uv.y)).r); }

  // Lines of equal u and v, as wide on the screen as they are there.
  float lines(vec2 uv) {
    vec2 at = uv * 48.0, width = fwidth(at) + 0.03;
    vec2 line = smoothstep(width * 1.6, width * 0.4, abs(fract(at - 0.5) - 0.5));
    return max(line.x, line.y) * (1.0 - smoothstep(0.25, 0.7, max(width.x, width.y)));
  }

  // Largest and smallest change of length: eigenvalues of the metric in the pose relative to that at rest, both by painted UV.
  vec2 strain(vec2 uv) {
    vec3 px = dFdx(ownPosition), py = dFdy(ownPosition);
    mat2 J = mat2(dFdx(uv), dFdy(uv));
    // Beside charts it has an alpha of 0.
    vec4 filtered = texture2D(restMetric, uv);
    vec3 rest = filtered.xyz / max(filtered.w, 1e-3);
    float det = J[0][0] * J[1][1] - J[1][0] * J[0][1];
    if (abs(det) < 1e-14 || rest.x <= 0.0) { return vec2(0.0); }
    mat2 inverse = mat2(J[1][1], -J[0][1], -J[1][0], J[0][0]) / det;
    vec3 a = px * inverse[0][0] + py * inverse[0][1], b = px * inverse[1][0] + py * inverse[1][1];
    vec3 m = vec3(dot(a, a), dot(a, b), dot(b, b));
    float area = rest.x * rest.z - rest.y * rest.y;
    float half_ = 0.5 * (m.x * rest.z - 2.0 * m.y * rest.y + m.z * rest.x) / area;
    float root = sqrt(max(half_ * half_ - (m.x * m.z - m.y * m.y) / area, 0.0));
    return sqrt(max(vec2(half_ + root, half_ - root), 0.0)) - 1.0;
  }
`;

const COLOUR = /* glsl */ `
  vec2 uv = ownUv;
  if (redirects > 0.0) { uv += texture2D(redirection, vec2(ownUv.x, 1.0 - ownUv.y)).rg; }
  float rigidHere = rigid(uv);
  diffuseColor.rgb = mix(ground, relief, rigidHere);
  diffuseColor.rgb = mix(diffuseColor.rgb, ground * 2.2 + 0.02, 0.55 * lines(uv) * (1.0 - rigidHere));
  if (look == ${LOOKS.rigidity}.0) {
    diffuseColor.rgb = mix(vec3(0.16, 0.18, 0.22), vec3(0.95, 0.42, 0.10), texture2D(rigidity, vec2(uv.x, 1.0 - uv.y)).r);
  } else if (look == ${LOOKS.strain}.0) {
    vec2 s = strain(uv);
    float most = abs(s.x) > abs(s.y) ? s.x : s.y;
    vec3 tint = most > 0.0 ? vec3(0.90, 0.10, 0.06) : vec3(0.08, 0.25, 0.95);
    float amount = smoothstep(0.02, 0.35, abs(most));
    // What is elastic may stretch.
    diffuseColor.rgb = mix(vec3(0.10, 0.11, 0.13), mix(vec3(0.75), tint, amount), rigidHere);
  }
  float away = distance(uv, brush) / brushRadius;
  float ring = fwidth(away);
  diffuseColor.rgb = mix(diffuseColor.rgb, vec3(1.0), (1.0 - smoothstep(ring, 2.5 * ring, abs(away - 1.0))) * 0.9);
`;

export class Skin {
  readonly own: MeshPhysicalMaterial;
  readonly redirected: MeshPhysicalMaterial;
  readonly brush = { value: new Vector2(-9, -9) };
  readonly brushRadius = { value: 0.02 };
  readonly redirection: DataTexture;
  readonly rigidity: DataTexture;
  #look = { value: LOOKS.paint as number };

  constructor(renderer: WebGLRenderer, geometry: BufferGeometry, values: Uint8Array, size: number, colours: [number[], number[]]) {
    this.redirection = new DataTexture(new Uint16Array(2 * MAP * MAP), MAP, MAP, RGFormat, HalfFloatType);
    this.rigidity = new DataTexture(values, size, size, RedFormat, UnsignedByteType);
    this.rigidity.generateMipmaps = true;
    this.rigidity.minFilter = LinearMipmapLinearFilter;
    for (const texture of [this.redirection, this.rigidity]) {
      texture.magFilter = LinearFilter;
      texture.needsUpdate = true;
    }
    this.redirection.minFilter = LinearFilter;
    this.rigidity.anisotropy = renderer.capabilities.getMaxAnisotropy();
    const restMetric = metric(renderer, geometry);
    [this.own, this.redirected] = [0, 1].map((redirects) => this.#material(redirects, restMetric, colours)) as [
      MeshPhysicalMaterial,
      MeshPhysicalMaterial,
    ];
  }

  set look(look: Look) {
    this.#look.value = LOOKS[look];
    for (const material of [this.own, this.redirected]) {
      material.envMapIntensity = look === "paint" ? 1 : 0.6;
    }
  }

  /** Shows the maps that belong to the pose that is shown. */
  redirect(delta: Uint16Array): void {
    this.redirection.image.data = delta;
    this.redirection.needsUpdate = true;
  }

  #material(redirects: number, restMetric: unknown, [ground, relief]: [number[], number[]]): MeshPhysicalMaterial {
    const material = new MeshPhysicalMaterial({ clearcoat: 0.45, clearcoatRoughness: 0.22, side: DoubleSide });
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, {
        rigidity: { value: this.rigidity },
        redirection: { value: this.redirection },
        restMetric: { value: restMetric },
        redirects: { value: redirects },
        ground: { value: ground },
        relief: { value: relief },
        look: this.#look,
        brush: this.brush,
        brushRadius: this.brushRadius,
      });
      const varyings = "varying vec2 ownUv;\nvarying vec3 ownPosition;\n";
      shader.vertexShader = varyings + shader.vertexShader.replace(
        "#include <project_vertex>",
        "ownUv = uv;\nownPosition = position;\n#include <project_vertex>",
      );
      shader.fragmentShader = DECLARATIONS + shader.fragmentShader
        .replace("#include <map_fragment>", COLOUR)
        // Gilded metal on glazed enamel.
        .replace("#include <roughnessmap_fragment>", "float roughnessFactor = look == 0.0 ? mix(0.38, 0.42, rigidHere) : 0.75;")
        .replace("#include <metalnessmap_fragment>", "float metalnessFactor = look == 0.0 ? 0.7 * rigidHere : 0.0;")
        // The relief's slope tilts the normal.
        .replace("#include <normal_fragment_maps>", /* glsl */ `
          vec3 sx = dFdx(-vViewPosition), sy = dFdy(-vViewPosition);
          float height = look == 0.0 ? 0.008 * smoothstep(0.05, 0.95, texture2D(rigidity, vec2(uv.x, 1.0 - uv.y)).r) : 0.0;
          vec3 r1 = cross(sy, normal), r2 = cross(normal, sx);
          float area = dot(sx, r1);
          normal = normalize(abs(area) * normal - sign(area) * (dFdx(height) * r1 + dFdy(height) * r2));
        `);
    };
    material.customProgramCacheKey = () => "vrtm";
    return material;
  }
}

/** The metric of the surface at rest, as E, F and G per texel of the tile: drawn once, in UV. */
function metric(renderer: WebGLRenderer, geometry: BufferGeometry): unknown {
  const size = 512;
  const target = new WebGLRenderTarget(size, size, { type: HalfFloatType, minFilter: LinearFilter, magFilter: LinearFilter });
  const material = new ShaderMaterial({
    vertexShader: `attribute vec3 rest; varying vec3 at;
      void main() { at = rest; gl_Position = vec4(2.0 * uv - 1.0, 0.0, 1.0); }`,
    fragmentShader: `varying vec3 at;
      void main() {
        vec3 a = dFdx(at) * ${size}.0, b = dFdy(at) * ${size}.0;
        gl_FragColor = vec4(dot(a, a), dot(a, b), dot(b, b), 1.0);
      }`,
    side: DoubleSide,
    depthTest: false,
  });
  const mesh = new Mesh(geometry, material);
  mesh.frustumCulled = false;
  const stage = new Stage();
  stage.add(mesh);
  renderer.setRenderTarget(target);
  renderer.setClearColor(0, 0);
  renderer.render(stage, new OrthographicCamera());
  renderer.setRenderTarget(null);
  stage.remove(mesh);
  material.dispose();
  return target.texture;
}
