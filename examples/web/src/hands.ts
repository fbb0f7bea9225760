/** Pointers and keys: they move the line between the pictures, turn the character, and play. */
import type { Stage } from "./stage.js";

export interface Host {
  isPainting(): boolean;
  play(): void;
  /** Moves the pose by some seconds. */
  step(seconds: number): void;
}

export function hands(stage: Stage, host: Host) {
  const { body } = document;
  const { canvas } = stage;
  const [handle, drop] = ["wipe", "drop"].map((id) => document.getElementById(id)!);

  /** Puts line and titles where the pictures are. */
  function layout(): void {
    const side = stage.compare === "side";
    const isWide = canvas.clientWidth >= canvas.clientHeight;
    body.dataset.panes = side && stage.solved ? (isWide ? "beside" : "stacked") : "one";
    const percent = stage.solved ? 100 * (side ? 0.5 : stage.wipe) : 100;
    canvas.parentElement!.style.setProperty("--wipe", `${percent}%`);
    handle.setAttribute("aria-valuenow", percent.toFixed(0));
  }

  function wipeTo(share: number): void {
    stage.wipe = Math.min(0.97, Math.max(0.03, share));
    layout();
    stage.draw();
  }

  const share = ({ clientX }: PointerEvent) => {
    const { left, width } = canvas.getBoundingClientRect();
    return (clientX - left) / width;
  };
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons === 0 && event.pointerType === "mouse" && !host.isPainting()) {
      wipeTo(share(event));
    }
  });
  handle.addEventListener("pointerdown", ({ pointerId }) => handle.setPointerCapture(pointerId));
  handle.addEventListener("pointermove", (event) => {
    if (event.buttons > 0 || (event.pointerType === "mouse" && !host.isPainting())) {
      wipeTo(share(event));
    }
  });

  const arrows = ({ key }: KeyboardEvent) =>
    [["Left", "Right"], ["Down", "Up"]].map(([less, more]) => +(key === `Arrow${more}`) - +(key === `Arrow${less}`));
  handle.addEventListener("keydown", (event) => wipeTo(stage.wipe + 0.02 * arrows(event)[0]));
  canvas.addEventListener("keydown", (event) => {
    const [right, up] = arrows(event);
    stage.turn(0.1 * right, 0.1 * up);
  });
  addEventListener("keydown", (event) => {
    const on = event.target as HTMLElement;
    if (event.key === " " && !on.matches("button, select, summary, input:not([type=range])")) {
      event.preventDefault();
      host.play();
    } else if (event.key.startsWith("Arrow") && on === body) {
      host.step(arrows(event)[0] / 24);
    }
  });

  addEventListener("dragover", () => (drop.hidden = false));
  for (const end of ["dragleave", "drop"] as const) {
    // Null where the file leaves the window, and where it is dropped.
    addEventListener(end, ({ relatedTarget }) => (drop.hidden = relatedTarget === null));
  }
  return { layout, wipeTo };
}
