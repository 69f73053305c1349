"""Time integration of a scene: method, scheme, transfer, step size, clock (Karamelo's Update)."""

from typing import Any, NamedTuple

from karamelo_py.language import registry
from karamelo_py.schemes.musl import MUSL
from karamelo_py.script.errors import Place
from karamelo_py.script.values import Values


class Update:
    """Choices of method, scheme, set_dt and dt_factor, and the clock."""

    remembers = ("warned_of_bounces", "warned_of")

    def __init__(self, values: Values):
        self.values = values
        self.method: Any = None
        self.transfer: Any = None  # a NamedTuple: PIC, FLIP, APIC ...
        self.scheme: Any = MUSL()
        self.scheme_place: Place | None = None  # in the script, as of the others below
        self.thermal = False  # heat flows between points
        self.anti_locking = False  # changes of volume are averaged against volumetric locking
        self.fixed_dt: float | None = None  # of set_dt; None: the step follows the fastest point
        self.dt_factor: float | None = None  # share of the stable step; None: the program chooses
        self.dt_place: Place | None = None
        self.boundary = "error"  # or delete or reflect, for points that reach the edge
        self.boundary_place: Place | None = None
        self.warned_of_bounces = False  # the user knows that points were reflected
        self.warned_of: list[str] = []  # names of failures that the user knows of
        self.moving: tuple[list[Any], float] = ([], 0.0)  # fixes of the last run, and since when

    def first_time(self, name: str) -> bool:
        """Note that the user is warned of something; False where that was so before."""
        first = name not in self.warned_of
        self.warned_of += [name] * first
        return first

    @property
    def words(self) -> str:
        """Method, transfer, basis and scheme, as a script calls them."""
        words = [
            registry.name_of("method", type(self.method)),
            _with_numbers(registry.name_of("transfer", type(self.transfer)), self.transfer),
            _with_numbers(self.method.basis_name, self.method.basis),
            _with_numbers(registry.name_of("scheme", type(self.scheme)), self.scheme),
        ]
        return " ".join([*words, *(["thermo-mechanical"] if self.thermal else [])])

    @property
    def step(self) -> int:
        """Number of steps taken."""
        return int(self.values.get("timestep"))

    @property
    def time(self) -> float:
        """Present time."""
        return self.values.get("time")

    @property
    def dt(self) -> float:
        """The next step."""
        return self.values.get("dt")

    def transfer_tag(self, real: type) -> Any:
        """The transfer with its numbers in the precision of the run."""
        numbers = (real(x) if isinstance(x, float) else x for x in self.transfer)
        return type(self.transfer)(*numbers)


def _with_numbers(name: str, tag: NamedTuple) -> str:
    """``FLIP (alpha 0.99)``."""
    numbers = ", ".join(
        f"{key} {value:g}" if isinstance(value, (int, float)) else f"{key} {value}"
        for key, value in tag._asdict().items()
    )
    return name + (f" ({numbers})" if numbers else "")
