"""A hub with a domain and a material, and arguments as a script has them."""

from karamelo_py.language.arguments import Argument
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.scene.hub import Hub
from karamelo_py.script.parser import parse
from karamelo_py.styles.solids import RegionSolid

DENSITY = 1000.0


def arguments(*texts):
    """Arguments from texts or numbers; nan and inf are variables, as measured values may be."""
    (call,) = parse(f"f({', '.join(map(str, texts))})", "in.test")
    interpreter = Interpreter(Hub())
    interpreter.variables.update(nan=float("nan"), inf=float("inf"))
    return [Argument(raw, interpreter) for raw in call.arguments]


class SmallHub(Hub):
    """A hub after its first lines: a cube as domain, the linear basis, the material "steel".

    Parameters
    ----------
    dimension
        0: no domain yet.
    lo, hi, h
        Ends of the domain in all directions, and its cells.
    """

    def __init__(self, dimension=2, lo=-0.5, hi=0.5, h=0.05):
        super().__init__(Console(quiet=True))
        self.warnings = []
        self.interpreter = Interpreter(self)
        lines = ["method(ulmpm, FLIP, linear, 1)"]
        if dimension:
            lines += [f"dimension({dimension}{f', {lo!r}, {hi!r}' * dimension}, {h!r})"]
        lines += [f"material(steel, linear, {DENSITY}, 1e9, 0.3)"]
        self.interpreter.run_text("\n".join(lines))
        self.mark = None

    def warn(self, message, mark=None, hint=None, expected=None):
        self.warnings.append(message)

    def use(self, method, basis):
        """Take another method, with this basis."""
        self.update.method = method(self)
        self.update.method.basis = basis

    def region(self, ID, style, *texts):
        """Make and file a region of class `style`."""
        return self.regions.add(ID, style(self, *arguments(*texts)))

    def combine(self, ID, style, *parts):
        """Make and file a region from other regions."""
        return self.regions.add(ID, style(self, *parts))

    def solid(self, ID, region, ppc=2, h=None, **options):
        """Make and file a solid."""
        steel = self.materials["steel"]
        solid = RegionSolid(self, region, ppc, steel, h or self.domain.h, **options)
        return self.solids.add(ID, solid)
