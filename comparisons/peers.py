"""python -m comparisons.peers [CELLS [ROUNDS]]: the same cube in Taichi, Warp and karamelo-py.

A cube of neo-Hookean rubber in 3D (MLS, quadratic splines, 8 points per cell, double precision) on
one core: the workload `block-3d-mls` of `karamelo-py bench`. Each round runs the programs one after
another. Prints the medians in million point-steps per second, from the difference of a long and a
short run, and the kinetic energy at the end, in which the programs agree to 0.1 %.
Needs ``pip install taichi warp-lang``.
"""

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

E, NU, RHO, SPIN = 1000.0, 0.3, 1000.0, 0.1

SCRIPT = """
method(ulmpm, MLS, quadratic-spline)
scheme(usl)
h = 1/{cells}
dimension(3, 0, 2, 0, 2, 0, 2, h)
region(cube, block, 0.5, 1.5, 0.5, 1.5, 0.5, 1.5)
material(rubber, neo-hookean, {rho}, {E}, {nu})
solid(cube, region, cube, 2, rubber, h, 0)
fix(v, initial_velocity_particles, all, {spin}*y0, {spin}*z0, {spin}*x0)
set_dt(0.02*h)
set_output(1000000)
run(m)
"""


def scene(cells: int) -> Any:
    """Numbers and start of the cube: positions and velocities of (n, 3) points."""
    h = 1 / cells
    at = 0.5 + h / 4 + h / 2 * np.arange(2 * cells)
    x = np.stack(np.meshgrid(at, at, at, indexing="ij"), -1).reshape(-1, 3)
    return SimpleNamespace(
        h=h, dt=0.02 * h, x=x, v=SPIN * x[:, [1, 2, 0]], count=len(x), volume=(h / 2) ** 3,
        mass=RHO * (h / 2) ** 3, mu=E / (2 * (1 + NU)), lam=E * NU / ((1 + NU) * (1 - 2 * NU)),
        nodes=(2 * cells + 3,) * 3,
    )  # fmt: skip


def in_taichi(s: Any) -> tuple[Callable, Callable]:
    import taichi as ti

    ti.init(arch=ti.cpu, cpu_max_num_threads=1, default_fp=ti.f64, fast_math=True,
            offline_cache=False, log_level=ti.ERROR)  # fmt: skip
    x, v = (ti.Vector.field(3, ti.f64, s.count) for _ in range(2))
    C, F = (ti.Matrix.field(3, 3, ti.f64, s.count) for _ in range(2))
    momentum, mass = ti.Vector.field(3, ti.f64, s.nodes), ti.field(ti.f64, s.nodes)
    x.from_numpy(s.x)
    v.from_numpy(s.v)
    F.from_numpy(np.tile(np.eye(3), (s.count, 1, 1)))

    @ti.func
    def weights(fx):
        return [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1) ** 2, 0.5 * (fx - 0.5) ** 2]

    @ti.kernel
    def to_grid():
        one = ti.Matrix.identity(ti.f64, 3)
        for p in x:
            base = (x[p] / s.h - 0.5).cast(int)
            fx = x[p] / s.h - base.cast(ti.f64)
            w = weights(fx)
            F[p] = (one + s.dt * C[p]) @ F[p]
            tau = (
                s.mu * (F[p] @ F[p].transpose()) + (s.lam * ti.log(F[p].determinant()) - s.mu) * one
            )
            Q = -(s.dt * s.volume * 4 / s.h / s.h) * tau + s.mass * C[p]
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                node = ti.Vector([i, j, k])
                weight = w[i][0] * w[j][1] * w[k][2]
                arm = (node.cast(ti.f64) - fx) * s.h
                momentum[base + node] += weight * (s.mass * v[p] + Q @ arm)
                mass[base + node] += weight * s.mass

    @ti.kernel
    def at_nodes():
        for n in ti.grouped(mass):
            if mass[n] > 0:
                momentum[n] /= mass[n]

    @ti.kernel
    def to_points():
        for p in x:
            base = (x[p] / s.h - 0.5).cast(int)
            fx = x[p] / s.h - base.cast(ti.f64)
            w = weights(fx)
            velocity, gradient = ti.Vector.zero(ti.f64, 3), ti.Matrix.zero(ti.f64, 3, 3)
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                node = ti.Vector([i, j, k])
                weight = w[i][0] * w[j][1] * w[k][2]
                velocity += weight * momentum[base + node]
                gradient += (
                    (4 / s.h) * weight * momentum[base + node].outer_product(node.cast(ti.f64) - fx)
                )
            v[p], C[p] = velocity, gradient
            x[p] += s.dt * velocity

    def steps(count: int) -> None:
        for _ in range(count):
            momentum.fill(0)
            mass.fill(0)
            to_grid()
            at_nodes()
            to_points()
        ti.sync()

    return steps, v.to_numpy


def in_warp(s: Any) -> tuple[Callable, Callable]:
    import warp as wp

    wp.config.quiet = True
    wp.init()
    real, vec, mat = wp.float64, wp.vec3d, wp.mat33d
    h, dt, m, volume, mu, lam = (real(a) for a in (s.h, s.dt, s.mass, s.volume, s.mu, s.lam))
    half, one, four = real(0.5), real(1.0), real(4.0)

    @wp.func
    def weights(f: real):
        a, b = real(1.5) - f, f - half
        return vec(half * a * a, real(0.75) - (f - one) * (f - one), half * b * b)

    @wp.kernel
    def to_grid(
        x: wp.array(dtype=vec), v: wp.array(dtype=vec), C: wp.array(dtype=mat),
        F: wp.array(dtype=mat), mass: wp.array3d(dtype=real), momentum: wp.array3d(dtype=vec),
    ):  # fmt: skip
        p = wp.tid()
        at = x[p] / h
        i, j, k = wp.int32(at[0] - half), wp.int32(at[1] - half), wp.int32(at[2] - half)
        wx, wy, wz = weights(at[0] - real(i)), weights(at[1] - real(j)), weights(at[2] - real(k))
        unit = wp.identity(n=3, dtype=real)
        G = (unit + dt * C[p]) * F[p]
        F[p] = G
        tau = mu * (G * wp.transpose(G)) + (lam * wp.log(wp.determinant(G)) - mu) * unit
        Q = -(dt * volume * four / h / h) * tau + m * C[p]
        for a in range(3):
            for b in range(3):
                for c in range(3):
                    arm = h * vec(real(i + a) - at[0], real(j + b) - at[1], real(k + c) - at[2])
                    weight = wx[a] * wy[b] * wz[c]
                    wp.atomic_add(momentum, i + a, j + b, k + c, weight * (m * v[p] + Q * arm))
                    wp.atomic_add(mass, i + a, j + b, k + c, weight * m)

    @wp.kernel
    def at_nodes(mass: wp.array3d(dtype=real), momentum: wp.array3d(dtype=vec)):
        i, j, k = wp.tid()
        if mass[i, j, k] > real(0.0):
            momentum[i, j, k] = momentum[i, j, k] / mass[i, j, k]

    @wp.kernel
    def to_points(
        x: wp.array(dtype=vec), v: wp.array(dtype=vec), C: wp.array(dtype=mat),
        momentum: wp.array3d(dtype=vec),
    ):  # fmt: skip
        p = wp.tid()
        at = x[p] / h
        i, j, k = wp.int32(at[0] - half), wp.int32(at[1] - half), wp.int32(at[2] - half)
        wx, wy, wz = weights(at[0] - real(i)), weights(at[1] - real(j)), weights(at[2] - real(k))
        velocity, gradient = vec(), mat()
        for a in range(3):
            for b in range(3):
                for c in range(3):
                    weight = wx[a] * wy[b] * wz[c]
                    arm = vec(real(i + a) - at[0], real(j + b) - at[1], real(k + c) - at[2])
                    node = momentum[i + a, j + b, k + c]
                    velocity = velocity + weight * node
                    gradient = gradient + (four / h * weight) * wp.outer(node, arm)
        v[p] = velocity
        C[p] = gradient
        x[p] = x[p] + dt * velocity

    x, v = (wp.array(a, dtype=vec, device="cpu") for a in (s.x, s.v))
    C = wp.zeros(s.count, dtype=mat, device="cpu")
    F = wp.array(np.tile(np.eye(3), (s.count, 1, 1)), dtype=mat, device="cpu")
    mass = wp.zeros(s.nodes, dtype=real, device="cpu")
    momentum = wp.zeros(s.nodes, dtype=vec, device="cpu")

    def steps(count: int) -> None:
        for _ in range(count):
            mass.zero_()
            momentum.zero_()
            wp.launch(to_grid, s.count, [x, v, C, F, mass, momentum], device="cpu")
            wp.launch(at_nodes, s.nodes, [mass, momentum], device="cpu")
            wp.launch(to_points, s.count, [x, v, C, momentum], device="cpu")

    return steps, v.numpy


def in_karamelo_py(s: Any) -> tuple[Callable, Callable]:
    import tempfile
    from pathlib import Path

    from karamelo_py import Simulation

    text = SCRIPT.format(cells=round(1 / s.h), rho=RHO, E=E, nu=NU, spin=SPIN)
    script = Path(tempfile.mkdtemp()) / "in.cube"
    script.write_text(text)
    last: list[Any] = []

    def steps(count: int) -> float:
        simulation = Simulation(str(script), m=count, threads=1)
        begun = time.perf_counter()
        simulation.run()
        last[:] = [simulation]
        return time.perf_counter() - begun

    def velocities() -> np.ndarray:
        return np.stack([last[0].points[name] for name in ("vx", "vy", "vz")], 1)

    return steps, velocities


PROGRAMS = {"taichi": in_taichi, "warp": in_warp, "karamelo-py": in_karamelo_py}


def measure(program: str, cells: int) -> tuple[float, float]:
    """Million point-steps per second, and the kinetic energy after the last step.

    A run of karamelo-py starts the cube again, so it repeats all steps of the other programs.
    """
    s = scene(cells)
    short = max(4, int(4e6 / s.count)) if s.count > 1e5 else 60
    again = program == "karamelo-py"

    def seconds(steps: Callable, count: int) -> float:
        begun = time.perf_counter()
        alone = steps(count)
        return time.perf_counter() - begun if alone is None else alone

    steps, velocities = PROGRAMS[program](s)
    steps(2)  # compiles
    first = seconds(steps, short)
    longer = seconds(steps, 3 * short)
    if again:
        steps(2 + 4 * short)
    energy = 0.5 * s.mass * float((velocities() ** 2).sum())
    return 2 * short * s.count / (longer - first) / 1e6, energy


def main(cells: str = "23", rounds: str = "3") -> None:
    runs_of: dict[str, list[list[float]]] = {name: [] for name in PROGRAMS}
    core = {min(os.sched_getaffinity(0))}
    for _ in range(int(rounds)):
        for name in PROGRAMS:
            command = [sys.executable, "-m", "comparisons.peers", "--alone", name, cells]
            done = subprocess.run(
                command, capture_output=True, text=True, check=True,
                preexec_fn=lambda: os.sched_setaffinity(0, core),
            )  # fmt: skip
            runs_of[name].append([float(word) for word in done.stdout.split()[-2:]])
    ours = statistics.median(speed for speed, _ in runs_of["karamelo-py"])
    for name, runs in runs_of.items():
        speed = statistics.median(speed for speed, _ in runs)
        print(f"{name:12} {speed:7.2f} million/s  energy {runs[-1][1]:.6e}  {ours / speed:5.1f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--alone"]:
        print(*measure(sys.argv[2], int(sys.argv[3])))
    else:
        main(*sys.argv[1:])
