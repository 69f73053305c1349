"""Functions for fix python that keep something from step to step."""

import numpy as np

remembers = ("strokes", "sent", "log")
strokes = 0
sent = np.zeros(2)
log = {"last": [], "seen": ()}


def push(points):
    """Pump ever stronger."""
    global strokes, sent
    strokes += 1
    points.force[:, 0] += points.mass * np.sin(strokes)
    sent += points.force.sum(axis=0)
    log["last"].append(float(points.velocity[0, 0]))
    log["seen"] = (*log["seen"], strokes)
    points.force[:, 1] += log["last"][0] * len(log["seen"])
    return sent


class Brake:
    """Nodes are braked by what they have been braked by so far."""

    remembers = ("used",)

    def __init__(self):
        self.used = 0.0

    def __call__(self, nodes):
        v = nodes.velocity_update
        v[:] *= 0.9 - 0.1 * np.tanh(self.used)
        self.used += float(np.abs(v).sum())
        return self.used


brake = Brake()
