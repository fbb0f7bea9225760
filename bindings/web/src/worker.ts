/** The worker of a `WorkerAsset`: it has one asset, and answers one question after the other. */
import { Asset, load } from "./index.js";
import type { Answer, Question, Redirected } from "./messages.js";

let asset: Asset | undefined;

async function answer(question: Question): Promise<[unknown, Transferable[]]> {
  if (question.name === "create") {
    await load(question.wasm);
    asset = new Asset(question.mesh);
    return [asset.tiles, []];
  }
  if (!asset) {
    throw new Error("there is no asset");
  }
  switch (question.name) {
    case "setRigidity":
      return [asset.setRigidity(question.tile, question.values, question.width, question.height), []];
    case "setMask":
      return [asset.setMask(question.tile, question.values, question.width, question.height), []];
    case "updateRigidity": {
      const { tile, values, width, height, part } = question;
      return [asset.updateRigidity(tile, values, width, height, part), []];
    }
    case "setSettings":
      return [asset.setSettings(question.tile, question.settings), []];
    case "cornerUvs": {
      const uvs = asset.cornerUvs(question.uvSet);
      return [uvs, [uvs.buffer]];
    }
    case "redirect": {
      const solved = asset;
      solved.solve(question.positions, question.options);
      const images = question.fetches.map(({ tile, kind, width, height, half }) =>
        half ? solved.fetchHalf(tile, kind, width, height) : solved.fetch(tile, kind, width, height),
      );
      const reports = solved.tiles.map((_, tile) => solved.report(tile));
      const redirected: Redirected = { images, reports };
      return [redirected, images.map((image) => image.buffer)];
    }
  }
}

// Questions are answered in their order, also while the first one loads.
let last: Promise<void> = Promise.resolve();
self.onmessage = ({ data }: MessageEvent<Question>) => {
  last = last.then(async () => {
    try {
      const [value, transfer] = await answer(data);
      (self as unknown as Worker).postMessage({ id: data.id, value } satisfies Answer, transfer);
    } catch (thrown) {
      const { name, message } = thrown as Error;
      self.postMessage({ id: data.id, error: { name, message } } satisfies Answer);
    }
  });
};
