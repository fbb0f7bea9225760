/** Materials of three.js that look their textures up at redirected UVs. */
import { ShaderChunk, type IUniform, type Material, type Texture } from "three";

/** Uniforms of a patched material; each is `vrtm` and its name in the shader (`vrtmStrength`). */
export interface Uniforms {
  /** The redirection: half floats, the first row at v = 1, what is added to a UV of vrtm. */
  map: IUniform<Texture>;
  /** Share of the redirection that is applied, 0 (own UVs) to 1. */
  strength: IUniform<number>;
  /** Pixel of the drawing buffer, from the left, up to which own UVs are drawn. */
  wipe: IUniform<number>;
}

export interface PatchOptions {
  /** Number of the UV set that is redirected, the `channel` of its textures. By default 0. */
  uv?: number;
  /** `Source.flipY`: the images' first rows are at v = 1. By default true, as three.js loads images itself. */
  flipY?: boolean;
}

/** Derivatives of own UVs are known in each pixel, and those of the redirection from neighbouring texels: differences
 * between redirected pixels would be wrong where a block of four reaches over the border of a chart. */
const declarations = (flipY: boolean) => /* glsl */ `
uniform sampler2D vrtmMap;
uniform float vrtmStrength, vrtmWipe;
varying vec2 vrtmOwn;
// Redirected UV, its distance from the own one, its derivatives by x and y of the screen, and the turn of the tangents.
vec2 vrtmUv, vrtmDelta;
mat2 vrtmGrad;
mat3 vrtmTurn = mat3( 1.0 );
vec2 vrtmDeltaAt( vec2 uv ) {
  vec2 delta = textureLod( vrtmMap, ${flipY ? "vec2( uv.x, 1.0 - uv.y )" : "uv"}, 0.0 ).rg;
  return ${flipY ? "delta" : "delta * vec2( 1.0, - 1.0 )"};
}
`;

const REDIRECT = /* glsl */ `
void vrtmRedirect() {
  float strength = gl_FragCoord.x < vrtmWipe ? 0.0 : vrtmStrength;
  vec2 texel = 1.0 / vec2( textureSize( vrtmMap, 0 ) ), h = vec2( texel.x, 0.0 ), v = vec2( 0.0, texel.y );
  vrtmDelta = strength * vrtmDeltaAt( vrtmOwn );
  vrtmUv = vrtmOwn + vrtmDelta;
  mat2 jacobian = mat2( 1.0 ) + 0.5 * strength * mat2(
    ( vrtmDeltaAt( vrtmOwn + h ) - vrtmDeltaAt( vrtmOwn - h ) ) / texel.x,
    ( vrtmDeltaAt( vrtmOwn + v ) - vrtmDeltaAt( vrtmOwn - v ) ) / texel.y );
  mat2 own = mat2( dFdx( vrtmOwn ), dFdy( vrtmOwn ) );
  vrtmGrad = jacobian * own;
#ifdef USE_TANGENT
  // The redirected tangent is dP/du' = dP/du du/du' + dP/dv dv/du'. Vertex tangents have no lengths.
  vec3 px = dFdx( vViewPosition ), py = dFdy( vViewPosition );
  float u = length( px * own[ 1 ].y - py * own[ 0 ].y ), w = length( py * own[ 0 ].x - px * own[ 1 ].x );
  vec2 turn = vec2( u * jacobian[ 1 ].y, - w * jacobian[ 0 ].y );
  turn = dot( turn, turn ) > 0.0 ? normalize( turn ) : vec2( 1.0, 0.0 );
  vrtmTurn = mat3( turn.x, turn.y, 0.0, - turn.y, turn.x, 0.0, 0.0, 0.0, 1.0 );
#endif
}
void main() {
  vrtmRedirect();
`;

const MAIN = /void\s+main\s*\(\s*\)\s*\{/;
/** A varying with its texture's transform, a look-up, a derivative, and the UV alone. */
const UV = new RegExp([
  /(?:uniform mat3 \w+Transform;\s*)?varying vec2 v([A-Z]\w*)?Uv;/, /texture2D\(\s*(\w+),\s*v([A-Z]\w*)?Uv\b([^()]*)\)/,
  /dFd([xy])\( v([A-Z]\w*)?Uv \)/, /\bv([A-Z]\w*)?Uv\b/,
].map(({ source }) => source).join("|"), "g");

const resolved = (text: string): string =>
  text.replace(/^[ \t]*#include +<(\w+)>/gm, (line, name: keyof typeof ShaderChunk) =>
    name in ShaderChunk ? resolved(ShaderChunk[name]) : line);

/** Writes a fragment shader for redirected UVs; `transformOf` gives the uniform of a texture's transform, "" for none,
 * and `undefined` for textures of other UV sets. */
function redirected(text: string, head: string, transformOf: (slot?: string) => string | undefined): string {
  const matrix = (slot?: string) => `mat2( ${transformOf(slot) || 1.0} )`;
  const body = resolved(text)
    // The frame of tangents takes derivatives in place of the UV.
    .replace(/(mat3 getTangentFrame\([^)]*)vec2 uv/, "$1mat2 uv")
    .replace(/dFd([xy])\( uv\.st \)/g, (_, axis) => `uv[ ${axis === "x" ? 0 : 1} ]`)
    .replace(/getTangentFrame\( -[^;]*/g, (call) => call.replace(/v([A-Z]\w*)?Uv\b/g, "mat2( dFdx( $& ), dFdy( $& ) )"))
    .replace(/mat3\( normalize\( vTangent \), normalize\( vBitangent \), normal \)/g, "$& * vrtmTurn")
    .replace(UV, (whole, declared, sampler, looked, rest, axis, derived, plain) => {
      const slot: string | undefined = declared ?? looked ?? derived ?? plain;
      const transform = transformOf(slot);
      if (transform === undefined) {
        return whole;
      }
      if (whole.includes("varying")) {
        return `${transform && `uniform mat3 ${transform}; `}varying vec2 v${slot ?? ""}Uv;`;
      }
      if (axis) {
        return `( ${matrix(slot)} * vrtmGrad[ ${axis === "x" ? 0 : 1} ] )`;
      }
      const uv = `( v${slot ?? ""}Uv + ${matrix(slot)} * vrtmDelta )`;
      const gradient = `${matrix(slot)} * vrtmGrad`;
      return sampler ? `textureGrad( ${sampler}, ${uv}${rest}, ( ${gradient} )[ 0 ], ( ${gradient} )[ 1 ] )` : uv;
    })
    .replace(MAIN, () => REDIRECT);
  // Functions before `main`, as that of bump maps, read the redirected UV, too.
  return head + body;
}

/** Replaces a method of an object, and returns what takes that back. */
export function replace<T extends object, K extends keyof T>(object: T, name: K, make: (before: T[K]) => T[K]) {
  const isOwn = Object.hasOwn(object, name);
  const before = object[name];
  const after = (object[name] = make(before));
  return () => {
    // One that was put in its place later stays.
    if (object[name] === after) {
      object[name] = before;
      if (!isOwn) {
        delete object[name];
      }
    }
  };
}

const patched = new WeakSet<Material>();

/** Lets a material look up redirected UVs, after its own `onBeforeCompile`, and returns what takes that back. GLSL of
 * that function finds the redirected UV in `vrtmUv`, the own one in `vrtmOwn`. */
export function patch(material: Material, uniforms: Uniforms, { uv = 0, flipY = true }: PatchOptions = {}): () => void {
  if (patched.has(material)) {
    throw new Error(`material "${material.name}" is redirected already: meshes with maps of their own need clones`);
  }
  patched.add(material);
  const head = declarations(flipY);
  const attribute = uv === 0 ? "uv" : `uv${uv}`;
  const transformOf = (slot?: string) => {
    if (!slot) {
      return uv === 0 ? "" : undefined;
    }
    const name = slot[0].toLowerCase() + slot.slice(1);
    const texture = (material as unknown as Record<string, Texture | null | undefined>)[name];
    return texture && texture.channel === uv ? `${name}Transform` : undefined;
  };
  let isLive = true;
  const undo = [
    replace(material, "onBeforeCompile", (before) => (shader, renderer) => {
      before.call(material, shader, renderer);
      if (isLive) {
        for (const [name, uniform] of Object.entries(uniforms)) {
          shader.uniforms[`vrtm${name[0].toUpperCase()}${name.slice(1)}`] = uniform;
        }
        const declared = uv === 0 ? "" : `#ifndef USE_UV${uv}\nattribute vec2 ${attribute};\n#endif\n`;
        const own = `${declared}varying vec2 vrtmOwn;\n`;
        shader.vertexShader = shader.vertexShader.replace(MAIN, (main) => `${own}${main}\nvrtmOwn = ${attribute};`);
        shader.fragmentShader = redirected(shader.fragmentShader, head, transformOf);
      }
    }),
    replace(material, "customProgramCacheKey", (before) => () =>
      before.call(material) + (isLive ? `${uv} ${head}` : "")),
  ];
  material.needsUpdate = true;
  return () => {
    isLive = false;
    undo.forEach((call) => call());
    patched.delete(material);
    // three.js would give the program that it has kept to a later patch, with the uniforms of this one.
    material.dispose();
  };
}
