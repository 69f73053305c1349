"""XPIC: the terms w_k = (1 - S+ S)^k S+ v of its series, from nodes to points and back."""

from collections import namedtuple
from typing import NamedTuple

from karamelo_py.compiler import real
from karamelo_py.compiler.fields import field, store, vector
from karamelo_py.kernels import arrays
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.equations.loss import reflect, term_at
from karamelo_py.kernels.equations.node_updates import node_task, per_mass
from karamelo_py.points.transfers.xpic import Series, TermOfSeries


class SeriesTerm(namedtuple("SeriesTerm", "k"), eq.Task):
    says = "term of the series to the points"
    reads = ("x",)
    writes = ("term of series",)

    def empty(task, w, x):
        return x - x

    def gathered(task, node, total):
        return total + node.N * term_at(node, total)

    def updated(task, pt, total, totals, fastest):
        store(pt.of(TermOfSeries), pt.p, total)
        reflect(pt, total, task.k)
        return eq.Report(real(0, pt.dt), fastest)


@eq.reads("term of series")
def term(pt):
    return pt.load(TermOfSeries, pt.v)


class SeriesBack(eq.ExtensiveQuantity):
    says = "term of the series to the grid"
    takes = eq.of_point(mass=eq.mass, term=term)
    gives = (
        eq.Sum(
            eq.NodeColumns(Series, vector, vector, Series.shape),
            lambda pt, node: node.N * pt.mass * pt.term,
        ),
    )


@node_task
class StartSeries(NamedTuple):
    goes_through = ("sums", "series", "update", "update")

    def at_node(task, kin, nodes, n, dt):
        series = field(nodes.fields, Series)
        factor = per_mass(nodes, n, dt)
        for k in range(kin.dimension):
            series[n, k] = nodes.sums[n, arrays.of_momentum(kin) + k] * factor
            nodes.update[n, arrays.of_change(kin) + k] = nodes.update[n, k]


@node_task
class ExtendSeries(NamedTuple):
    goes_through = ("sums", "series", "series", "update", "update")

    def at_node(task, kin, nodes, n, dt):
        d = kin.dimension
        series = field(nodes.fields, Series)
        factor = per_mass(nodes, n, dt)
        for k in range(d):
            v = series[n, k] - series[n, d + k] * factor
            series[n, k] = v
            nodes.update[n, arrays.of_change(kin) + k] += v
