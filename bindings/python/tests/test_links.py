"""The description that registries show, bindings/links.py: its links lead into the repository, or are text."""

import importlib.util

from conftest import REPOSITORY

spec = importlib.util.spec_from_file_location("links", REPOSITORY / "bindings" / "links.py")
links = importlib.util.module_from_spec(spec)
spec.loader.exec_module(links)

TEXT = """\
![A picture](../../docs/images/sheet.png) of [this](
../README.md#a-b), [here](#there), and [there](https://example.org/a).
"""


def test_links(tmp_path, monkeypatch):
    file = tmp_path / "one" / "two" / "README.md"
    file.parent.mkdir(parents=True)
    file.write_text(TEXT)
    monkeypatch.setattr(links, "ROOT", tmp_path)
    monkeypatch.delenv("VRTM_REPOSITORY", raising=False)
    assert links.absolute(file, "1.2") == " of this, here, and [there](https://example.org/a).\n"
    monkeypatch.setenv("VRTM_REPOSITORY", "https://example.org/v/")
    assert links.absolute(file, "1.2") == (
        "![A picture](https://example.org/v/raw/v1.2/docs/images/sheet.png) of "
        "[this](https://example.org/v/blob/v1.2/one/README.md#a-b), "
        "[here](https://example.org/v/blob/v1.2/one/two/README.md#there), and [there](https://example.org/a).\n"
    )
