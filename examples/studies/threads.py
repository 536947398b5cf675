"""Time and memory of one body against its number of nodes and the number of threads.

Each line is a process of its own: python3 examples/studies/threads.py [NODES...]
A block of 0.2 m is pulled down by its weight; nodes, supports, assembly, factor and one solve are timed (wall clock).
"""

import resource
import subprocess
import sys
import time

import spherecut as sc

NODES = [2000, 10000, 20000, 50000]
EDGE = 0.2  # m


def one(count: int, threads: int) -> None:
    sc.set_thread_count(threads)
    spacing = EDGE / (count ** (1 / 3) - 0.5)
    domain = sc.Domain.box([0, 0, 0], [EDGE, EDGE, EDGE], 2 * spacing)
    begin = time.perf_counter()
    nodes = sc.sprinkle(domain, sc.Spacing(spacing)).nodes
    sprinkled = time.perf_counter() - begin
    held = [sc.Held(sc.Region.half_space([0, 0, 0.1 * spacing], [0, 0, 1]))]
    begin = time.perf_counter()
    body = sc.Body(domain, nodes, sc.Material(1e4, 0.3), held, body_force=[0, 0, -1e3])
    built = time.perf_counter() - begin
    begin = time.perf_counter()
    residual = body.residual(body.solve())
    solved = time.perf_counter() - begin
    report = body.report
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    print(f"| {len(nodes)} | {threads} | {sprinkled:.2f} | {report['supports_seconds'] + report['assembly_seconds']:.2f} | "
          f"{report['factor_seconds']:.2f} | {solved:.2f} | {sprinkled + built + solved:.1f} | {memory:.1f} | {residual:.0e} |", flush=True)


if len(sys.argv) == 4 and sys.argv[1] == "--one":
    one(int(sys.argv[2]), int(sys.argv[3]))
else:
    print("| nodes | threads | sprinkling | assembly | factor | solve | in all, s | GB | residual |\n|---|---|---|---|---|---|---|---|---|", flush=True)
    for count in [int(word) for word in sys.argv[1:]] or NODES:
        for threads in (1, 2):
            subprocess.run([sys.executable, __file__, "--one", str(count), str(threads)], check=True)
