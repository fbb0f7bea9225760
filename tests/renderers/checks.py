"""Output of a file of checks: a line per check, with figures, and the number of checks."""

import pathlib
import re
import sys
import traceback

FOLDER = pathlib.Path(__file__).resolve().parent
REPOSITORY = FOLDER.parent.parent
ASSETS = REPOSITORY.parent / "shared" / "assets"

failures = 0


def check(name, held, figures):
    global failures
    failures += not held
    print(f"{'ok' if held else 'FAILED'} {name}: {figures}", flush=True)


def skip(name, why):
    # The name comes first: a line that begins with "skipped:" would belong to a test of cargo's.
    print(f"{name} skipped: {why}", flush=True)


def within(name, difference, mean, p99, most, beside=""):
    """A difference (in 255ths: mean / 99th percentile / largest) that must not be larger than bounds."""
    held = difference.mean <= mean and difference.p99 <= p99 and difference.max <= most
    check(name, held, f"{difference} of 255 (at most {mean} / {p99} / {most}){beside}")


def run(*parts):
    """Runs functions; one that raises is a failed check, and the rest still runs. Ends the program."""
    for part in parts:
        try:
            part()
        except Exception as error:
            traceback.print_exc()
            check(part.__name__, False, f"{type(error).__name__}: {error}")
    print("end", flush=True)
    sys.stdout.flush()
    sys.exit(failures != 0)


def document(heading, language):
    """The code block in that language under that heading in docs/rendering: what users read is what is tested."""
    text = "".join(page.read_text() for page in sorted((REPOSITORY / "docs" / "rendering").glob("*.md")))
    sections = re.split(r"^#+ ", text, flags=re.M)
    found = [block for section in sections if section.split("\n")[0] == heading
             for block in re.findall(rf"^```{language}\n(.*?)^```", section, flags=re.M | re.S)]
    if len(found) != 1:
        raise LookupError(f"docs/rendering: {len(found)} blocks in {language} under {heading!r}, not one")
    return found[0]
