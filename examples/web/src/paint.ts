/** Paints what keeps its shape: a brush, a pipette, what a texture tells, and undo. */
import { MOUSE, TOUCH, Vector3 } from "three";
import { load, rigidity } from "vrtm";
import { dab, under, type Hit, type Touched } from "./brush.js";
import { shared } from "./looks.js";
import type { Stage } from "./stage.js";
import type { Open, Part } from "./state.js";
import { Steps, around, copy, type Change, type Rect } from "./steps.js";

/** What the page tells, and is told. */
export interface Host {
  open(): Open | undefined;
  /** Another map is set: solve. */
  changed(): void;
  /** A character that moves cannot be painted. */
  pause(): void;
  say(text: unknown): void;
}

/** Most dabs between two places of the pointer. */
const DABS = 24;

interface Stroke {
  pointer: number;
  last: { clientX: number; clientY: number };
  touched: Map<Part, Touched>;
}

export function mount(panel: HTMLElement, stage: Stage, host: Host) {
  const { canvas, controls } = stage;
  const input = (name: string) => panel.querySelector<HTMLInputElement>(`[name=${name}]`)!;
  const value = (name: string) => Number(input(name).value);
  let tool = "turn";
  let loaded = false;
  let steps = new Steps();
  let of: Open | undefined;
  let stroke: Stroke | undefined;
  const fingers = new Set<number>();
  /** The last colour that was picked, and its step. */
  let picked: { colour: number[]; step?: Change[] } | undefined;

  /** What is open; steps of what was open before are forgotten. */
  function opened(): Open | undefined {
    const open = host.open();
    if (open !== of) {
      [of, steps, stroke, picked] = [open, new Steps(), undefined, undefined];
      show();
    }
    return open;
  }

  function show(): void {
    input("undo").disabled = steps.done.length === 0;
    input("redo").disabled = steps.undone.length === 0;
    const isBrush = tool === "paint" || tool === "erase";
    panel.querySelectorAll<HTMLElement>(".brush").forEach((row) => (row.hidden = !isBrush));
    panel.querySelector<HTMLElement>(".pick")!.hidden = tool !== "pick";
    panel.querySelector<HTMLElement>(".texture")!.hidden = !host.open()?.parts.some(({ texture }) => texture);
  }

  // One message to the worker at a time, with all that changed meanwhile.
  const dirty = new Map<Part, Rect>();
  let sending = false;
  async function send(): Promise<void> {
    const open = of;
    while (dirty.size > 0 && !sending) {
      sending = true;
      await undefined;
      const all = [...dirty];
      dirty.clear();
      try {
        await Promise.all(all.map(([part, rect]) => part.redirected.updateRigidity(part.rigidity, rect)));
        host.changed();
      } catch (error) {
        if (open === host.open()) {
          host.say(error);
        }
      }
      sending = false;
    }
  }

  function changed(part: Part, rect: Rect): void {
    dirty.set(part, around(dirty.get(part), rect));
    stage.repaint(part);
    show();
    void send();
  }

  function hitAt(event: Stroke["last"]): Hit | undefined {
    const [seen, open] = [loaded ? stage.ray(event) : null, opened()];
    return seen && open ? under(seen, open.parts) : undefined;
  }

  /** Follows the pointer, with dabs on the way from its last place. */
  function follow(event: PointerEvent): void {
    const moves = event.getCoalescedEvents?.() ?? [];
    for (const { clientX, clientY } of moves.length > 0 ? moves : [event]) {
      const { last } = stroke!;
      const [dx, dy] = [clientX - last.clientX, clientY - last.clientY];
      const count = Math.min(DABS, Math.max(1, Math.ceil((3 * Math.hypot(dx, dy)) / value("radius"))));
      for (let k = 1; k <= count; k++) {
        const hit = hitAt({ clientX: last.clientX + (dx * k) / count, clientY: last.clientY + (dy * k) / count });
        const rect = hit && dab(hit, stroke!.touched, value("radius"), value("softness"), tool === "erase" ? 0 : 255);
        if (rect) {
          changed(hit.part, rect);
        }
      }
      stroke!.last = { clientX, clientY };
    }
  }

  function ring(event?: PointerEvent): void {
    const hit = event && (tool === "paint" || tool === "erase") ? hitAt(event) : undefined;
    const { x, y, z } = hit?.world ?? new Vector3();
    shared.brush.value.set(x, y, z, hit ? value("radius") * hit.pixel : 0);
    stage.draw();
  }

  /** Ends a stroke; one that turned out to be a turn is taken back. */
  function end(isTurn = false): void {
    const changes = [...(stroke?.touched ?? [])].map(([part, { before, rect }]): Change =>
      ({ part, rect: rect!, texels: copy(before, part.size, rect!) }));
    stroke = undefined;
    steps.keep(changes);
    if (isTurn && changes.length > 0) {
      move("done");
      steps.undone = [];
    }
    show();
  }

  function move(from: "done" | "undone"): void {
    steps.move(from).forEach(({ part, rect }) => changed(part, rect));
    show();
  }

  /** Replaces the maps of all parts, as one step. */
  function whole(make: (part: Part) => Uint8Array | undefined): void {
    host.pause();
    const before: Change[] = [];
    for (const part of opened()?.parts ?? []) {
      const [to, { rigidity: map, size }] = [make(part), part];
      let rect: Rect | undefined;
      to?.forEach((texel, k) => {
        if (texel !== map[k]) {
          rect = around(rect, [k % size, Math.floor(k / size), 1, 1]);
        }
      });
      if (rect) {
        before.push({ part, rect, texels: copy(map, size, rect) });
        map.set(to!);
        changed(part, rect);
      }
    }
    steps.keep(before);
    show();
  }

  /** Adds what a texture tells. */
  function add(make: (texture: ImageData, part: Part) => Uint8Array): void {
    whole((part) => part.texture
      ? make(part.texture, part).map((texel, k) => Math.max(texel, part.rigidity[k]))
      : undefined);
  }

  function pick(hit: Hit | undefined): void {
    const texture = hit?.part.texture;
    if (!hit || !texture) {
      return hit && host.say("This part has no texture that a colour could be picked from.");
    }
    const { source: { flipY }, redirected } = hit.part;
    const turned = ([u, v]: number[]) => (flipY ? [u, v] : [u, 1 - v]);
    const [x, y] = turned(hit.uv);
    const [u, v] = turned(hit.redirected ? redirected.uvAt({ x, y }).toArray() : [x, y]);
    const at = (t: number, n: number) => Math.floor((t - Math.floor(t)) * n);
    const first = 4 * (at(1 - v, texture.height) * texture.width + at(u, texture.width));
    picked = { colour: [...texture.data.subarray(first, first + 3)].map((byte) => byte / 255) };
    alike();
  }

  /** What has the colour that was picked, in the place of what had it before with another tolerance. */
  function alike(): void {
    if (picked?.step && picked.step === steps.done.at(-1)) {
      move("done");
    }
    if (picked) {
      add((texture, { size }) => rigidity.ofColour(texture, picked!.colour, value("tolerance"), [size, size]));
      picked.step = steps.done.at(-1);
    }
  }

  async function ready(): Promise<void> {
    await load(new URL("vrtm_bg.wasm", location.href));
    loaded = true;
    panel.dataset.ready = "";
    opened();
  }

  /** Shows what is rigid while a tool is on, and lets it fade after. */
  async function choose(name: string): Promise<void> {
    tool = name;
    show();
    const isOn = tool !== "turn";
    controls.mouseButtons.LEFT = isOn ? null : MOUSE.ROTATE;
    controls.mouseButtons.RIGHT = isOn ? MOUSE.ROTATE : MOUSE.PAN;
    controls.touches.ONE = isOn ? null : TOUCH.ROTATE;
    controls.touches.TWO = isOn ? TOUCH.DOLLY_ROTATE : TOUCH.DOLLY_PAN;
    canvas.style.cursor = isOn ? "crosshair" : "";
    ring();
    if (isOn) {
      shared.overlay.value = 1;
      await ready();
      return;
    }
    for (let last = performance.now(); tool === "turn" && shared.overlay.value > 0; ) {
      stage.draw();
      const now = await new Promise(requestAnimationFrame);
      shared.overlay.value = Math.max(0, shared.overlay.value - (now - last) / 700);
      last = now;
    }
    stage.draw();
  }

  panel.querySelectorAll<HTMLInputElement>("[name=tool]").forEach((radio) =>
    radio.addEventListener("change", () => choose(radio.value).catch(host.say)));
  const pressed: Record<string, () => void> = {
    undo: () => move("done"),
    redo: () => move("undone"),
    clear: () => whole(({ rigidity: map }) => new Uint8Array(map.length)),
    bright: () => add((texture, { size }) => rigidity.ofBrightness(texture, 0, [size, size])),
    dark: () => add((texture, { size }) => rigidity.ofBrightness(texture, 0, [size, size]).map((texel) => 255 - texel)),
    detail: () => add((texture, { rigidity: map, size }) =>
      rigidity.ofDetail(texture, map.some((texel) => texel > 127) ? map : undefined, 0.3, [size, size])),
  };
  for (const [name, call] of Object.entries(pressed)) {
    input(name).addEventListener("click", () => ready().then(call).catch(host.say));
  }
  input("tolerance").addEventListener("input", alike);
  addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y") && !stroke) {
      event.preventDefault();
      move(key === "z" && !event.shiftKey ? "done" : "undone");
    } else if ((key === "[" || key === "]") && tool !== "turn") {
      input("radius").value = String(value("radius") * (key === "]" ? 1.2 : 1 / 1.2));
    }
  });

  canvas.addEventListener("pointerdown", (event) => {
    fingers.add(event.pointerId);
    if (fingers.size > 1) {
      end(true);
    } else if (loaded && (tool === "paint" || tool === "erase") && event.button === 0) {
      host.pause();
      canvas.setPointerCapture(event.pointerId);
      stroke = { pointer: event.pointerId, last: event, touched: new Map() };
      follow(event);
      ring(event);
    }
  });
  canvas.addEventListener("pointermove", (event) => {
    if (stroke?.pointer === event.pointerId) {
      follow(event);
    }
    if (tool !== "turn" && fingers.size < 2) {
      ring(event);
    }
  });
  for (const name of ["pointerup", "pointercancel"] as const) {
    canvas.addEventListener(name, ({ pointerId }) => {
      fingers.delete(pointerId);
      if (stroke?.pointer === pointerId) {
        end();
      }
    });
  }
  canvas.addEventListener("pointerleave", () => ring());
  canvas.addEventListener("drawn", opened);
  canvas.addEventListener("click", (event) => tool === "pick" && pick(hitAt(event)));
  show();
  return { isOn: () => tool !== "turn" };
}
