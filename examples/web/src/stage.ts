/** The picture: camera, light, one pane with a wipe or two, rings, and what the pointer is over. */
import {
  Box3, DirectionalLight, HemisphereLight, NeutralToneMapping, PMREMGenerator, PerspectiveCamera, Raycaster, Scene,
  Sphere, Vector2, Vector3, WebGLRenderer, type Object3D, type Ray, type Texture,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import { dress, shared } from "./looks.js";
import type { Part } from "./state.js";

/** What is seen under a pointer. */
export interface Sight {
  ray: Ray;
  redirected: boolean;
  pixel: number;
}

export class Stage {
  readonly renderer: WebGLRenderer;
  readonly controls: OrbitControls;
  readonly camera = new PerspectiveCamera(30, 1, 0.1, 100);
  readonly scene = new Scene();
  /** Place of the wipe, a share of the width. */
  wipe = 0.5;
  compare: "wipe" | "side" = "wipe";
  /** Redirected pictures are there: until then there is one pane without a wipe. */
  solved = false;
  #root: Object3D | undefined;
  #parts: Part[] = [];
  #dressed = new Map<Part, ReturnType<typeof dress>>();
  #away = 1;
  #caster = new Raycaster();
  #wanted = false;
  #environment: Texture | undefined;
  #sky = new HemisphereLight(0xf2f7fa, 0xb9c4c4, 2.9);

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    const sun = new DirectionalLight(0xfff3e2, 1.7);
    sun.position.set(1.5, 4, 3);
    this.scene.add(sun, this.#sky);
    this.scene.environmentIntensity = 0.75;
    // Reflections take software seconds to make: there the first pictures do without.
    const context = this.renderer.getContext();
    const info = context.getExtension("WEBGL_debug_renderer_info");
    if (!info || !/swiftshader|llvmpipe|software/i.test(context.getParameter(info.UNMASKED_RENDERER_WEBGL))) {
      this.light();
    }
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener("webglcontextrestored", () => {
      this.#environment?.dispose();
      this.#environment = undefined;
      this.light();
      this.#dressed.forEach(({ redraw }) => redraw());
      this.draw();
    });
  }

  /** Makes the reflections, unless they are there. */
  light(): void {
    if (!this.#environment) {
      const generator = new PMREMGenerator(this.renderer);
      this.#environment = this.scene.environment = generator.fromScene(new RoomEnvironment(), 0.03).texture;
      generator.dispose();
      this.#sky.removeFromParent();
      this.draw();
    }
  }

  /** Shows another character, as it comes; `direction` is the place of the camera, a share of its usual distance. */
  show(root: Object3D, direction: number[]): void {
    this.close();
    this.#root = root;
    const { center, radius } = new Box3().setFromObject(root).getBoundingSphere(new Sphere());
    this.scene.add(root);
    this.controls.target.copy(center);
    const away = this.#away = radius / Math.sin((this.camera.fov * Math.PI) / 360);
    Object.assign(this.camera, { near: away / 100, far: away * 10 });
    this.camera.position.copy(new Vector3(...direction).multiplyScalar(away).add(center));
    this.controls.minDistance = radius * 0.3;
    this.controls.maxDistance = away * 2;
    this.controls.update();
    this.draw();
  }

  /** Adds the looks to what is shown, once its parts are there. */
  dress(parts: Part[]): void {
    this.#parts = parts;
    parts.forEach((part) => this.#dressed.set(part, dress(part, this.renderer)));
    this.draw();
  }

  /** `direction`, now. */
  view(): number[] {
    return this.camera.position.clone().sub(this.controls.target).divideScalar(this.#away).toArray();
  }

  /** Turns the camera to the right and up, in radians. */
  turn(right: number, up: number): void {
    this.controls.rotateLeft(right);
    this.controls.rotateUp(up);
  }

  close(): void {
    this.#root?.removeFromParent();
    this.#dressed.forEach(({ dispose }) => dispose());
    this.#dressed.clear();
    this.#parts = [];
    this.solved = false;
    shared.rings.value.forEach((ring) => (ring.w = 0));
  }

  /** What is rigid has changed. */
  repaint(part: Part): void {
    this.#dressed.get(part)!.rigidity.needsUpdate = true;
    this.draw();
  }

  /** Draws with the next picture of the screen. */
  draw(): void {
    if (!this.#wanted) {
      this.#wanted = true;
      requestAnimationFrame(() => this.#draw());
    }
  }

  /** The ray under a pointer, and the size of a pixel at a distance of 1 in front of the camera. */
  ray({ clientX, clientY }: { clientX: number; clientY: number }): Sight | null {
    const box = this.canvas.getBoundingClientRect();
    const [x, y] = [clientX - box.left, clientY - box.top];
    const panes = this.#panes();
    const k = panes.findIndex(([left, top, w, h]) => x >= left && x < left + w && y >= top && y < top + h);
    if (k < 0) {
      return null;
    }
    const [left, top, width, height] = panes[k];
    this.#aim(width / height);
    this.camera.updateMatrixWorld();
    const { ray } = this.#caster;
    this.#caster.setFromCamera(new Vector2((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height), this.camera);
    const redirected = this.solved && (panes.length > 1 ? k === 1 : x >= this.wipe * box.width);
    return { ray, redirected, pixel: (2 * Math.tan((this.camera.fov * Math.PI) / 360)) / this.camera.zoom / height };
  }

  /** Left, top, width and height of the pictures: on a screen that is higher than wide, one over the other. */
  #panes(): number[][] {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (this.compare === "wipe" || !this.solved) {
      return [[0, 0, width, height]];
    }
    return width >= height
      ? [[0, 0, width / 2, height], [width / 2, 0, width / 2, height]]
      : [[0, 0, width, height / 2], [0, height / 2, width, height / 2]];
  }

  /** A pane that is higher than wide shows what a square one does. */
  #aim(aspect: number): void {
    this.camera.aspect = aspect;
    this.camera.zoom = Math.min(1, aspect);
    this.camera.updateProjectionMatrix();
  }

  #draw(): void {
    this.#wanted = false;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0 || this.renderer.getContext().isContextLost()) {
      return;
    }
    const size = this.renderer.getSize(new Vector2());
    if (size.x !== width || size.y !== height) {
      this.renderer.setSize(width, height, false);
    }
    this.renderer.setScissorTest(true);
    const panes = this.#panes();
    for (const [k, [left, top, w, h]] of panes.entries()) {
      for (const { redirected: { uniforms } } of this.#parts) {
        uniforms.strength.value = this.solved && (panes.length === 1 || k === 1) ? 1 : 0;
        uniforms.wipe.value = panes.length === 1 ? this.wipe * width * this.renderer.getPixelRatio() : 0;
      }
      this.#aim(w / h);
      this.renderer.setViewport(left, height - top - h, w, h);
      this.renderer.setScissor(left, height - top - h, w, h);
      this.renderer.render(this.scene, this.camera);
    }
    this.canvas.dispatchEvent(new Event("drawn"));
  }
}
