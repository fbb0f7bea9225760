/** vrtm for three.js: `redirect(mesh)` keeps what is painted on a mesh in shape while it deforms. */
export {
  fit, fitBasis, loadBasis, redirectByBasis, type Basis, type BasisOptions, type RedirectedByBasis, type Sums,
} from "./basis.js";
export { Source, type SourceOptions } from "./geometry.js";
export { patch, type PatchOptions, type Uniforms } from "./material.js";
export { lookUp, redirect, Redirected, type RedirectSettings, type Result } from "./redirect.js";
