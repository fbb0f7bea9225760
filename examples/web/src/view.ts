/** The two pictures: the same surface with its own UVs and redirected, from one camera. */
import {
  ACESFilmicToneMapping, Color, DirectionalLight, Mesh, PMREMGenerator, PerspectiveCamera, Raycaster, Scene as Stage, Vector2,
  Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import type { Skin } from "./skin.js";
import type { Surface } from "./surface.js";

/** What a pointer is over: the UV there, and whether it is on the redirected picture. */
export interface Hit {
  uv: Vector2;
  redirected: boolean;
}

export class View {
  readonly renderer: WebGLRenderer;
  readonly controls: OrbitControls;
  #camera = new PerspectiveCamera(32, 1, 0.1, 100);
  #stage = new Stage();
  #mesh: Mesh | undefined;
  #skin: Skin | undefined;
  #wanted = false;
  #canvas: HTMLCanvasElement;

  constructor(canvas: HTMLCanvasElement) {
    this.#canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.toneMapping = ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 0.8;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.#stage.background = new Color(0x14171d);
    this.#stage.environment = new PMREMGenerator(this.renderer).fromScene(new RoomEnvironment(), 0.03).texture;
    const sun = new DirectionalLight(0xfff1dd, 1.6);
    sun.position.set(2, 4, 3);
    this.#stage.add(sun);
    this.controls = new OrbitControls(this.#camera, canvas);
    this.controls.enablePan = false;
    this.controls.enableDamping = true;
    this.controls.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  /** Shows another mesh; `direction` is where the camera stands. */
  show(surface: Surface, skin: Skin, direction: number[]): void {
    if (this.#mesh) {
      this.#stage.remove(this.#mesh);
    }
    this.#mesh = new Mesh(surface.geometry, skin.own);
    this.#mesh.frustumCulled = false;
    this.#skin = skin;
    this.#stage.add(this.#mesh);
    const { center, radius } = surface.geometry.boundingSphere!;
    this.controls.target.copy(center);
    const wide = this.#panes()[0];
    const aspect = Math.min(1, wide[2] / wide[3]);
    const away = (radius * 0.93) / Math.sin((this.#camera.fov * Math.PI) / 360) / aspect;
    this.#camera.position.copy(new Vector3(...direction).normalize().multiplyScalar(away).add(center));
    this.controls.minDistance = radius * 0.6;
    this.controls.maxDistance = away * 2;
    this.controls.update();
    this.draw();
  }

  /** Draws with the next picture of the screen. */
  draw(): void {
    if (!this.#wanted) {
      this.#wanted = true;
      requestAnimationFrame(() => this.#draw());
    }
  }

  /** What is under a pointer. */
  pick(event: PointerEvent): Hit | null {
    const box = this.#canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const panes = this.#panes();
    const k = panes.findIndex(([left, top, width, height]) => x >= left && x < left + width && y >= top && y < top + height);
    if (!this.#mesh || k < 0) {
      return null;
    }
    const [left, top, width, height] = panes[k];
    this.#aim(width / height);
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height), this.#camera);
    const uv = ray.intersectObject(this.#mesh)[0]?.uv;
    return uv ? { uv, redirected: k === 1 } : null;
  }

  /** Left, top, width and height of both pictures: side by side or, on a screen that is higher than wide, one over the other. */
  #panes(): number[][] {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    return width >= height
      ? [[0, 0, width / 2, height], [width / 2, 0, width / 2, height]]
      : [[0, 0, width, height / 2], [0, height / 2, width, height / 2]];
  }

  #aim(aspect: number): void {
    this.#camera.aspect = aspect;
    this.#camera.updateProjectionMatrix();
  }

  #draw(): void {
    this.#wanted = false;
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    if (width === 0 || height === 0) {
      return;
    }
    this.renderer.setSize(width, height, false);
    this.renderer.setScissorTest(true);
    for (const [k, [left, top, w, h]] of this.#panes().entries()) {
      if (this.#mesh && this.#skin) {
        this.#mesh.material = k === 0 ? this.#skin.own : this.#skin.redirected;
      }
      this.#aim(w / h);
      this.renderer.setViewport(left, height - top - h, w, h);
      this.renderer.setScissor(left, height - top - h, w, h);
      this.renderer.render(this.#stage, this.#camera);
    }
    // Until the camera has come to rest.
    this.controls.update();
  }
}
