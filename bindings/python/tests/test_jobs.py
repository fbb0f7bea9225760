"""Jobs as futures, cancelling, progress, threads, Ctrl-C, and what happens at the end of a process."""

import asyncio
import concurrent.futures
import gc
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import numpy as np
import pytest

import vrtm
from conftest import refused, sheet, studded, until
from vrtm import _call

POSE = sheet(33).pose


@pytest.fixture
def slow(device):
    """An asset whose solves take long enough to be cancelled."""
    with studded(device, sheet(33), 1024, 64) as asset:
        asset.tile(1001).set_settings(grid_width=1024, grid_height=1024)
        yield asset


def test_result(asset, model):
    called = []
    job = asset.submit(model.pose)
    job.add_done_callback(called.append)
    assert concurrent.futures.wait([job], timeout=60).done == {job}
    assert job.result(60) == asset.report() and job.progress == 1.0 and job.done() and not job.running()
    assert job.exception() is None and not job.cancelled() and not job.cancel()
    job.close()
    assert called == [job]
    result = asset.tile(1001).fetch()
    asset.solve(model.rest)
    asset.solve(model.pose)
    assert np.array_equal(asset.tile(1001).fetch(), result)


class Held:
    """A progress function that keeps the solve where it is until it may go on."""

    def __init__(self):
        self.begun, self.go = threading.Event(), threading.Event()

    def __call__(self, fraction):
        self.begun.set()
        self.go.wait(60)


def test_busy_and_cancel(asset, model):
    held = Held()
    job = asset.submit(model.pose, progress=held)
    refused(vrtm.BusyError, "", asset.solve, model.pose)
    with pytest.raises(TimeoutError) as caught:
        job.result(0.001)
    assert isinstance(caught.value, vrtm.Error)
    assert held.begun.wait(60) and job.cancel()
    held.go.set()
    with pytest.raises(vrtm.CancelledError) as cancelled:
        job.result(60)
    assert isinstance(cancelled.value, concurrent.futures.CancelledError)
    assert job.cancelled() and job.cancel() and job.progress < 1
    refused(vrtm.NotSolvedError, "", asset.report)
    # It is free again, as it is after a block, whatever ends that.
    held = Held()
    with pytest.raises(KeyError), asset.submit(model.pose, progress=held) as job:
        held.go.set()
        raise KeyError
    assert job.done() and job.closed
    # A job cannot wait for itself.
    held, jobs = Held(), []
    jobs += [asset.submit(model.pose, progress=lambda fraction: held(fraction) or jobs[0].close())]
    held.go.set()
    refused(vrtm.BusyError, "cannot wait for it", jobs[0].result, 60)
    asset.solve(model.pose)


def test_a_cancelled_task_leaves_the_asset_free(asset, model):
    """Its end is the job's end: the next solve does not find the asset busy."""

    async def given_up(end):
        held = Held()
        job = asset.submit(model.pose, progress=held)
        task = asyncio.ensure_future(end(job))
        await asyncio.to_thread(held.begun.wait, 60)
        task.cancel()
        for _ in range(10):
            await asyncio.sleep(0)
        assert not task.done() and not job.done()
        held.go.set()
        await asyncio.wait([task])
        assert task.cancelled() and job.cancelled()
        # Of another pose: one that is solved has nothing left to be cancelled.
        assert (await asset.submit(model.rest)).tiles == 1

    async def cancelled():
        held = Held()
        job = asset.submit(model.pose, progress=held)
        assert held.begun.wait(60) and job.cancel()
        held.go.set()
        # It is the job that was cancelled, and not the task.
        with pytest.raises(vrtm.CancelledError):
            await job

    async def itself(job):
        return await job

    asyncio.run(given_up(itself))
    asyncio.run(given_up(lambda job: asyncio.wait_for(job, 60)))
    asyncio.run(cancelled())


def test_a_job_cannot_replace_itself(asset, model):
    """Refusals; examples/languages tests that the newest pose wins."""
    held = Held()
    job = asset.submit(model.pose, progress=lambda fraction: held(fraction) or asset.submit(model.rest, replace=True))
    held.go.set()
    refused(vrtm.BusyError, "", job.result, 60)
    refused(vrtm.InvalidArgumentError, "options.replace", asset.solve, model.pose, replace=True)


def test_progress(slow):
    seen = []
    slow.tile(1001).set_settings(grid_width=512, grid_height=512)
    slow.solve(POSE, progress=seen.append)
    assert len(seen) > 3 and seen == sorted(seen) and 0 <= seen[0] and seen[-1] <= 1
    refused(vrtm.CancelledError, "", slow.solve, POSE * 1.1, progress=lambda fraction: True)
    refused(ZeroDivisionError, "", slow.solve, POSE * 1.1, progress=lambda fraction: 1 / 0)
    refused(ZeroDivisionError, "", slow.submit(POSE * 1.1, progress=lambda fraction: 1 / 0).result, 60)
    # Whatever else a function returns is no wish to cancel.
    slow.solve(POSE * 1.1, progress=lambda fraction: np.float64(1))


def test_the_gil_is_released(slow):
    counted = 0
    job = slow.submit(POSE)
    thread = threading.Thread(target=concurrent.futures.wait, args=([job],))
    thread.start()
    while not job.done() and counted <= 1000:
        counted += 1
    job.cancel()
    thread.join()
    assert counted > 1000


def test_threads(device, model):
    """Assets of their own on threads of their own, and one asset's results read while it solves."""
    poses = [model.rest + (model.pose - model.rest) * k / 4 for k in range(1, 5)]

    def bake(pose):
        with studded(device, model) as asset:
            return asset.redirect(pose, asset.tiles)[0]

    alone = [bake(pose) for pose in poses]
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        for result, expected in zip(pool.map(bake, poses * 2), alone * 2):
            assert np.array_equal(result, expected)
    with studded(device, model) as asset:
        asset.solve(poses[0])
        held = Held()
        with asset.submit(poses[1], progress=held):
            assert held.begun.wait(60) and np.array_equal(asset.tile(1001).fetch(), alone[0])
            held.go.set()


PRELUDE = """
    import sys, signal, threading, time
    sys.path.insert(0, {tests!r})
    import numpy as np, vrtm
    from conftest import sheet, studded
    model = sheet(33)
    device = vrtm.Device("cpu")
    asset = studded(device, model, 1024, 64)
    asset.tile(1001).set_settings(grid_width=1024, grid_height=1024)
"""


def run(code):
    text = textwrap.dedent(PRELUDE.format(tests=str(Path(__file__).parent))) + textwrap.dedent(code)
    return subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=100)


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent otherwise there")
def test_ctrl_c():
    """Ctrl-C in the middle of a solve ends it, and the asset goes on."""
    done = run("""
        seen, cancelled, cancel = [], threading.Event(), vrtm.Asset.cancel

        def tell(fraction):
            seen.append(fraction)
            if len(seen) == 2:
                signal.raise_signal(signal.SIGINT)
                # However late the main thread looks.
                cancelled.wait(60)

        vrtm.Asset.cancel = lambda self: (cancel(self), cancelled.set())
        try:
            asset.solve(model.pose, max_corrections=7, progress=tell)
            print("not interrupted")
        except KeyboardInterrupt:
            print("interrupted" if seen[-1] < 0.9 else "late")
        asset.tile(1001).set_settings(grid_width=64, grid_height=64)
        print(asset.solve(model.pose).charts_active)
    """)
    assert done.stdout.split() == ["interrupted", "1"], done.stderr[-500:]


@pytest.mark.parametrize("has_begun", [True, False])
def test_ctrl_c_while_a_thread_starts(monkeypatch, has_begun):
    """A call that has begun by then is cancelled, and any other never begins."""

    class Interrupted(threading.Thread):
        def start(self):
            if has_begun:
                super().start()
                calls.wait(60)
            raise KeyboardInterrupt

    calls, cancelled = threading.Event(), threading.Event()
    monkeypatch.setattr(threading, "Thread", Interrupted)
    refused(KeyboardInterrupt, "", _call.interruptible, lambda: (calls.set(), cancelled.wait(60)), cancelled.set)
    assert calls.is_set() == cancelled.is_set() == has_begun


def test_the_end_of_a_process():
    """A process may end while jobs run that call Python functions, and with everything left open."""
    done = run("""
        other = studded(device, model)
        job = asset.submit(model.pose, max_corrections=7, progress=lambda fraction: time.sleep(0.01))
        time.sleep(0.1)
        print(job.running())
    """)
    assert done.returncode == 0 and done.stdout.split() == ["True"], done.stderr[-500:]
    assert done.stderr == ""


def test_nothing_is_left(model):
    """Objects that nobody holds any more give their memory back."""
    with vrtm.Device("cpu") as device:
        for _ in range(3):
            asset = studded(device, model)
            asset.submit(model.pose).result()
            assert device.info.bytes_held > 0
            del asset
            gc.collect()
            # The job's thread holds on to it for a moment longer.
            until(lambda: device.info.bytes_held == 0)


def test_log(model, caplog):
    lines = []
    with vrtm.Device("cpu", log=lines.append) as device:
        asset = studded(device, model)
    # The asset outlives the device, and so does the log.
    asset.solve(model.pose * 100)
    assert ("info", "device", 0) == (lines[0].level, lines[0].code, lines[0].udim)
    assert any(line.code == "tile" and line.udim == 1001 for line in lines)
    last = lines[-1]
    assert (last.level, last.code) == ("warning", "pose_scale") and "units" in last.message
    assert 50 < last.values[0] < 200 and last.values[1:] == (0,) * 5
    asset.close()
    assert not caplog.records
    # Without a function all goes to Python's logging.
    caplog.set_level("INFO", "vrtm")
    with vrtm.Device("cpu") as device, studded(device, model) as asset:
        asset.solve(model.pose * 100)
    assert {(record.name, record.levelname) for record in caplog.records} == {("vrtm", "INFO"), ("vrtm", "WARNING")}
