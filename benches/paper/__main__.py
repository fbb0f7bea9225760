"""The paper's figures and tables again, with scenes of our own: python benches/paper [options]

Writes docs/images/paper_*.jpg, benches/results/paper.json, and the tables into docs/paper.md. Needs what
requirements.txt lists, the package vrtm (pip install ./bindings/python), and cargo for the built-in scene, if
--scenes has none.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
# What each figure needs: an asset beside the checkout, a built-in scene, or scipy.
NEEDS = {"1": ["mh_face"], "5": [], "6": ["mug_to_jug", "scipy"], "7": []}


def parsed():
    parser = argparse.ArgumentParser(prog="benches/paper", description=__doc__.split("\n")[0])
    parser.add_argument("--figures", default="1,5,6,7", help="which figures, or 'none' (1,5,6,7)")
    parser.add_argument(
        "--tables",
        nargs="?",
        const="all",
        help="also measure tables 1 and 2, on a quiet machine; or only some rows, such as Face-1,MugJug",
    )
    parser.add_argument("--out", type=Path, default=REPOSITORY / "docs" / "images", help="for pictures (docs/images)")
    parser.add_argument("--results", type=Path, default=REPOSITORY / "benches" / "results", help="(benches/results)")
    parser.add_argument(
        "--scenes",
        type=Path,
        help="a folder for asset folders; what it lacks of the built-in scenes is written by the example `scene`",
    )
    parser.add_argument(
        "--assets",
        type=Path,
        default=REPOSITORY.parent / "shared" / "assets",
        help="the folder with mh_face (../shared/assets)",
    )
    parser.add_argument("--samples", type=int, default=24, help="samples per pixel, before denoising (24)")
    parser.add_argument("--quick", action="store_true", help="small sizes, no files: checks what has to hold")
    options = parser.parse_args()
    options.figures = [] if options.figures == "none" else options.figures.split(",")
    for name in options.figures:
        if name not in NEEDS:
            parser.error(f"--figures: there is no figure {name!r}, only {', '.join(NEEDS)}")
    if options.samples < 1:
        parser.error(f"--samples: {options.samples} is less than 1")
    return options


def scene(name, folder):
    """A built-in scene as an asset folder."""
    if not (folder / name / "asset.json").is_file():
        command = ["cargo", "run", "--release", "--quiet", "--example", "scene", "--", name, str(folder / name)]
        subprocess.run(command, cwd=REPOSITORY, check=True)
    return folder / name


def missing(needs, options, scenes):
    """Reason for which a figure cannot be made, or None."""
    for need in needs:
        if need == "scipy":
            try:
                import scipy  # noqa: F401
            except ImportError:
                return "it needs scipy: pip install -r benches/paper/requirements.txt"
        elif need == "mh_face":
            if not (options.assets / need).is_dir():
                return f"the face is not there: {options.assets / need} (option --assets)"
        else:
            try:
                scene(need, scenes)
            except (OSError, subprocess.CalledProcessError) as error:
                return f"the scene {need} cannot be made: {error}"
    return None


def makers():
    from figures import fig1, fig5, fig6, fig7

    return {
        "1": fig1.make,
        "5": fig5.make,
        "6": fig6.make,
        "7": fig7.make,
    }


def models(options, scenes):
    """A model for the tables, painted once, by its name."""
    import shapes
    from scenes import face, fish

    made = {}

    def get(name):
        if name not in made:
            made[name] = None
            if name == "face" and missing(["mh_face"], options, scenes) is None:
                made[name] = face.load(options.assets / "mh_face")
                face.stones(made[name], 4096)
            elif name == "mug" and missing(["mug_to_jug"], options, scenes) is None:
                made[name] = shapes.read(scenes / "mug_to_jug")
            elif name == "fish":
                made[name] = fish.build()
                fish.spikes(made[name], 1024)
        return made[name]

    return get


def document(results, path, file):
    """Writes the tables between the marks of the page, and into a file of their own."""
    import page

    text, tables = path.read_text(), page.tables(results)
    parts = ["# The paper's figures and tables again", "", "By `python benches/paper`; docs/paper.md has the pictures."]
    for name, lines in sorted(tables.items()):
        parts += ["", f"## {name.capitalize()}", "", *lines]
    file.write_text("\n".join(parts) + "\n")
    for name, lines in tables.items():
        block = f"<!-- {name} -->\n" + "\n".join(lines) + "\n<!-- end -->"
        text = re.sub(rf"<!-- {name} -->.*?<!-- end -->", lambda _, block=block: block, text, flags=re.S)
    path.write_text(text)


def main():
    options = parsed()
    sys.path.append(str(REPOSITORY / "tests" / "renderers"))
    if options.quick:
        import quick

        held = [
            (print(f"{'skipped' if h is None else 'ok' if h else 'FAILED'} {n}: {f}", flush=True), h)[1]
            for n, h, f in quick.checks(options.assets)
        ]
        sys.exit(any(h is False for h in held))
    from figures.common import Options
    from sheet import save

    file = options.results / "paper.json"
    results = json.loads(file.read_text()) if file.is_file() else {}
    with tempfile.TemporaryDirectory() as work:
        scenes = options.scenes or Path(work) / "scenes"
        shared = Options(Path(work), scenes, options.assets, options.samples)
        for name in options.figures:
            why = missing(NEEDS[name], options, scenes)
            if why:
                print(f"figure {name} left out: {why}")
                continue
            pictures, results[f"figure {name}"] = makers()[name](shared)
            for picture, image in pictures.items():
                print(f"{options.out / picture}: {save(image, options.out / picture) // 1000} KB", flush=True)
            file.write_text(json.dumps(results, indent=1) + "\n")
        if options.tables:
            import tables

            names = list(tables.ROWS) if options.tables == "all" else options.tables.split(",")
            for name in names:
                if name not in tables.ROWS:
                    sys.exit(f"--tables: there is no row {name!r}, only {', '.join(tables.ROWS)}")
            results["tables"] = tables.make(models(options, scenes), names, results.get("tables", {}))
            file.write_text(json.dumps(results, indent=1) + "\n")
    document(results, REPOSITORY / "docs" / "paper.md", options.results / "paper.md")


if __name__ == "__main__":
    main()
