"""Devices on the GPU of another program, which is known by its UUID."""

import os

import numpy as np
import pytest

import vrtm
from conftest import refused


def some_adapter():
    found = [adapter for adapter in vrtm.adapters() if adapter.has_uuid]
    if not found:
        assert os.environ.get("VRTM_REQUIRE_GPU") != "1", "VRTM_REQUIRE_GPU is set, but there is no GPU with a UUID"
        pytest.skip("no GPU adapter with a UUID")
    return found[0]


def test_an_adapter_tells_who_it_is():
    adapter = some_adapter()
    assert isinstance(adapter.uuid, bytes) and len(adapter.uuid) == len(adapter.driver_uuid) == 16
    assert any(adapter.uuid) and len(adapter.luid) == len(adapter.registry_id) == 8
    assert adapter.has_luid == any(adapter.luid) and isinstance(adapter.pci_bus, str)


def test_a_device_is_found_by_its_uuid():
    adapter = some_adapter()
    for uuid in (adapter.uuid, bytearray(adapter.uuid), np.frombuffer(adapter.uuid, np.uint8)):
        with vrtm.Device("gpu", adapter=99, adapter_uuid=uuid) as device:
            assert device.info.name == adapter.name and "by its UUID" in device.info.reason


def test_other_identities_are_refused():
    refused(ValueError, "adapter_uuid: 15 bytes, not 16", vrtm.Device, "gpu", adapter_uuid=bytes(15))
    refused(ValueError, "adapter_luid: 16 bytes, not 8", vrtm.Device, "gpu", adapter_luid=bytes(16))
    with pytest.raises(ValueError, match="adapter_luid: adapter_uuid is given"):
        vrtm.Device("gpu", adapter_uuid=bytes(16), adapter_luid=bytes(8))
    refused(TypeError, "", vrtm.Device, "gpu", adapter_uuid=5)
    adapter = some_adapter()
    with pytest.raises(vrtm.InvalidArgumentError, match="no adapter has the UUID 07070707-0707-"):
        vrtm.Device("gpu", adapter_uuid=bytes([7]) * 16)
    with pytest.raises(vrtm.InvalidArgumentError, match="no adapter has the LUID 0909090909090909; there are: 0: "):
        vrtm.Device("gpu", adapter_luid=bytes([9]) * 8)
    # "auto" never fails for it.
    with vrtm.Device(adapter_uuid=bytes([7]) * 16) as device:
        assert device.info.backend == "cpu" and "no GPU has the UUID" in device.info.reason
    assert adapter.uuid != bytes([7]) * 16


def test_memory_of_a_gpu_is_refused_on_the_cpu(asset, model):
    """Writing on a GPU is tested in crates/gpu/tests/gpu/external.rs, which has a Vulkan device of its own."""
    tile = asset.tile(1001)
    refused(vrtm.NotSolvedError, "", tile.fetch_external, "redirection", 8, 0, 512)
    asset.solve(model.pose)
    refused(vrtm.UnsupportedError, "tile: its device is the CPU", tile.fetch_external, "redirection", 8, 0, 512)
    refused(vrtm.UnsupportedError, "kind: Warp", tile.fetch_external, "warp", 8, 0, 512)
    refused(vrtm.InvalidArgumentError, r"image\.offset is 4", tile.fetch_external, "redirection", 8, 0, 516, offset=4)
    with pytest.raises(vrtm.InvalidArgumentError, match=r"image\.memory_size is 255"):
        tile.fetch_external("redirection_delta", 8, 0, 255, dtype=np.float16)
    refused(ValueError, "fd: -1 is not", tile.fetch_external, "redirection", 8, -1, 512)
    refused(ValueError, "origin: 'left'", tile.fetch_external, "redirection", 8, 0, 512, origin="left")
