"""Calls that take long: Ctrl-C ends them, other threads run meanwhile, errors of functions given by the user come back."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest
import spherecut as sc
from conftest import block_nodes

LONG = """
    import spherecut as sc
    domain = sc.Domain.box([0, 0, 0], [0.1, 0.1, 0.1], 0.01)
    nodes = sc.sprinkle(domain, sc.Spacing({spacing})).nodes
    material, held = sc.Material(1e4, 0.3), [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))]
    print("begun", len(nodes), flush=True)
    try:
        {handler}
        sc.Body(domain, nodes, material, held)
        print("finished", flush=True)
    except {error} as told:
        print("stopped", repr(told), flush=True)
    import numpy as np
    small = sc.sprinkle(domain, sc.Spacing(0.02)).nodes
    print("goes on", sc.Body(domain, small, material, held, body_force=[0, 0, -1e3]).solve().load_factor, flush=True)
"""


def interrupted(handler, error, spacing=0.0045):
    """What a program says that gets a SIGINT half a second into a build: of some 12,000 nodes, of many seconds."""
    program = subprocess.Popen([sys.executable, "-c", textwrap.dedent(LONG).format(handler=handler, error=error, spacing=spacing)],
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    said = [program.stdout.readline()]
    time.sleep(0.5)
    program.send_signal(signal.SIGINT)
    said.append(program.stdout.read())
    assert program.wait() == 0, said
    return "".join(said)


def test_ctrl_c_stops_a_long_build():
    said = interrupted("pass", "KeyboardInterrupt")
    assert "stopped KeyboardInterrupt()" in said and "finished" not in said
    assert "goes on 1.0" in said  # nothing of the request is left


def test_the_users_handler_is_called():
    handler = 'import signal; signal.signal(signal.SIGINT, lambda *_: (_ for _ in ()).throw(RuntimeError("my own")))'
    said = interrupted(handler, "RuntimeError")
    assert "stopped RuntimeError('my own')" in said and "finished" not in said


def test_a_program_that_ignores_sigint_goes_on():
    said = interrupted("import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)", "KeyboardInterrupt", spacing=0.008)
    assert "finished" in said and "stopped" not in said


def test_other_threads_run_in_a_long_call():
    """A thread of Python counts while a body is built; it could not with the interpreter's lock held."""
    domain = sc.Domain.box([0, 0, 0], [0.05, 0.05, 0.05], 0.01)
    nodes = sc.sprinkle(domain, sc.Spacing(0.005)).nodes
    inside, counts, stop = threading.Event(), [0, 0], threading.Event()

    def count():
        while not stop.is_set():
            counts[1 if inside.is_set() else 0] += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    inside.set()
    sc.Body(domain, nodes, sc.Material(1e4, 0.3), [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))])
    inside.clear()
    stop.set()
    counter.join()
    assert counts[1] > 20


def test_two_threads_work_on_bodies_of_their_own_and_on_one():
    domain, nodes = block_nodes(0.006)
    held = [sc.Held(lambda x, n: x[2] < 1e-9)]  # a function of Python's, from within a long call

    def solve(results, k):
        body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), held, body_force=lambda x: [0, 0, -1e4])
        results[k] = body.solve().coefficients

    results = [None, None]
    threads = [threading.Thread(target=solve, args=(results, k)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=120)
    assert results[0] is not None and np.array_equal(results[0], results[1])

    body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), held, body_force=[0, 0, -1e4])
    shared = [None] * 4

    def ask(k):
        for _ in range(20):
            shared[k] = body.at(nodes.positions[:50], body.solve()).displacement.copy()

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=120)
    assert all(one is not None and np.array_equal(one, shared[0]) for one in shared)


def test_threads_of_the_library_call_functions():
    domain, nodes = block_nodes(0.006)
    held = [sc.Held(lambda x, n: x[2] < 1e-9)]
    one = sc.Body(domain, nodes, sc.Material(1e4, 0.3), held, body_force=lambda x: [0, 0, -1e4 * x[2]]).solve()
    sc.set_thread_count(2)
    try:
        two = sc.Body(domain, nodes, sc.Material(1e4, 0.3), held, body_force=lambda x: [0, 0, -1e4 * x[2]]).solve()
    finally:
        sc.set_thread_count(1)
    assert np.array_equal(one.coefficients, two.coefficients)


def test_errors_of_functions_come_back():
    domain, nodes = block_nodes(0.008)

    class Own(Exception):
        pass

    def fails(x):
        raise Own("at", float(x[2]))

    foot = [sc.Held(sc.Region.half_space([0, 0, 0], [0, 0, 1]))]
    with pytest.raises(Own):
        sc.Body(domain, nodes, sc.Material(1e4, 0.3), foot, body_force=fails).solve()
    with pytest.raises(sc.InputError, match=r"body_force: an array of shape \(2,\); allowed: \(3,\)"):
        sc.Body(domain, nodes, sc.Material(1e4, 0.3), foot, body_force=lambda x: [1, 2]).solve()
    with pytest.raises(sc.InputError, match="body_force"):
        sc.Body(domain, nodes, sc.Material(1e4, 0.3), foot, body_force="down").solve()


def test_progress_through_tqdm(monkeypatch, small):
    tqdm = pytest.importorskip("tqdm.auto")
    seen = []

    class Bar:
        def __init__(self, steps, **options):
            self.steps, self.options = steps, options

        def __iter__(self):
            for step in self.steps:
                seen.append((step.time, self.options["desc"]))
                yield step

    monkeypatch.setattr(tqdm, "tqdm", Bar)
    run = sc.run(small, progress=True)
    assert len(seen) == len(run.results) and seen[0][1] == run.session.scenario.title
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)  # not there: no bar, unless it is asked for
    assert len(sc.run(small).results) == len(run.results)
    with pytest.raises(ImportError):
        sc.run(small, progress=True)


def test_interrupted_runs_keep_their_results(tmp_path, source):
    def stop(session, result):
        calls.append(result.time)
        if len(calls) == 3:
            os.kill(os.getpid(), signal.SIGINT)

    calls = []
    with pytest.raises(KeyboardInterrupt):
        sc.run(source / "scenarios" / "block_slice.toml", tmp_path / "run", after_step=stop)
    import json

    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert "interrupted" in json.dumps(summary) and len(calls) == 3
