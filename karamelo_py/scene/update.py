"""Time integration of a scene: method, scheme, transfer, step size, clock (Karamelo's Update)."""

from typing import Any, NamedTuple

from karamelo_py.language import registry
from karamelo_py.schemes.musl import MUSL
from karamelo_py.script.errors import Place
from karamelo_py.script.values import Values


class Update:
    """Choices of method, scheme, set_dt and dt_factor, and the clock.

    Attributes
    ----------
    method
        The method style, or None as long as there is none.
    transfer
        The transfer's NamedTuple (PIC, FLIP, APIC ...).
    thermal
        Whether heat flows between points.
    anti_locking
        Whether changes of volume are averaged against volumetric locking.
    scheme
        The scheme's tag.
    scheme_place
        Where the script says so.
    fixed_dt
        The constant step of set_dt, or None: the step follows the fastest point.
    dt_factor
        Share of the stable step that the script asks for, or None: the program chooses.
    dt_place
        Where the script asks for its step.
    boundary
        What happens to points that reach the edge of the domain: error, delete or reflect.
    boundary_place
        Where the script says so.
    warned_of_bounces
        Whether the user knows that points were reflected.
    warned_of
        Names of the failures that the user was warned of.
    moving
        The fixes of the last run, and since when none has come to them.
    """

    remembers = ("warned_of_bounces", "warned_of")

    def __init__(self, values: Values):
        self.values = values
        self.method: Any = None
        self.transfer: Any = None
        self.scheme: Any = MUSL()
        self.scheme_place: Place | None = None
        self.thermal = False
        self.anti_locking = False
        self.fixed_dt: float | None = None
        self.dt_factor: float | None = None
        self.dt_place: Place | None = None
        self.boundary = "error"
        self.boundary_place: Place | None = None
        self.warned_of_bounces = False
        self.warned_of: list[str] = []
        self.moving: tuple[list[Any], float] = ([], 0.0)

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
